"""Hears what `pilotage fly` sends to FlightGear: `flightgear.py PILOTAGE FOLDER VERSION`.

The packets are taken apart by flightgear-python, which we did not write. Prints what differs from where the vehicle stands.
"""

import math
import pathlib
import socket
import subprocess
import sys
from importlib import import_module

LATITUDE, LONGITUDE, HEADING, ELEVATION = 50.0, 8.5, 90.0, 100.0


def heard(port):
    """A socket that listens at that port of this computer; any where it is 0."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", port))
    listener.settimeout(20)
    return listener


def pair():
    """Two listeners, the second at the port after the first's."""
    for _ in range(100):
        vehicle = heard(0)
        try:
            return vehicle, heard(vehicle.getsockname()[1] + 1)
        except OSError:
            vehicle.close()
    raise OSError("no two ports in a row are free")


def main():
    pilotage, folder, version = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]
    layout = import_module(f"flightgear_python.fdm_v{version}").fdm_struct
    vehicle, marker = pair()
    place = f"{LATITUDE},{LONGITUDE},{HEADING},{ELEVATION}"
    command = [pilotage, "fly", "--no-browser", "-o", "flights", "--flightgear", f"127.0.0.1:{vehicle.getsockname()[1]}"]
    server = subprocess.Popen(command + ["--runway", place, "--flightgear-version", version], cwd=folder)
    try:
        # Until the session shows its first state there is none to be sent.
        for _ in range(60):
            packet = vehicle.recv(65536)
            line = marker.recv(65536).decode()
        pose, wrong = layout.parse(packet), []
        near = lambda name, own, expected: math.isclose(own, expected, rel_tol=1e-6, abs_tol=1e-6) or wrong.append(f"{name}: {own}, not {expected}")
        if layout.sizeof() != len(packet):
            wrong.append(f"{len(packet)} bytes, not {layout.sizeof()}")
        near("latitude", pose.lat_rad, math.radians(LATITUDE))
        near("longitude", pose.lon_rad, math.radians(LONGITUDE))
        near("height", pose.alt_m, ELEVATION + 3)
        near("height over ground", pose.agl_m, 3)
        near("heading", pose.psi_rad, math.radians(HEADING))
        near("visibility", pose.visibility_m, 20000)
        near("spoilers", pose.spoilers, 0)
        near("engines", pose.num_engines, 1)
        # The marker of the first task, 10 m to the east.
        latitude, longitude, _ = map(float, line.split(","))
        near("marker's latitude", latitude, LATITUDE)
        east = math.radians(longitude - LONGITUDE) * 6371008.8 * math.cos(math.radians(LATITUDE))
        if abs(east - 10) > 1e-3:
            wrong.append(f"the marker is {east} m to the east")
        print("\n".join(wrong))
    finally:
        server.terminate()
        server.wait(10)


if __name__ == "__main__":
    main()
