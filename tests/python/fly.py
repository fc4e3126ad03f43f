"""Flies `pilotage fly` in a browser to the end of a protocol: `fly.py PILOTAGE BROWSERS FOLDER`.

A scripted stick of known gain and lead, late by a known time and with a remnant, stands in the place of the gamepad, inside
the page: no driver can fake one, and a call through it takes too long. The page is reloaded in the middle of a run, and its socket dropped in another. What is wrong
with what the page shows is printed, else the results of the runs as JSON; `no browser` where there is none.
"""

import json
import pathlib
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from pages import LEAST, found, launched
from playwright.sync_api import TimeoutError, sync_playwright

GAIN, LEAD, LATE = 0.03, 2.0, 0.1  # [1/m], [s], [s]
# The remnant is a sum of sines of the time with phases by the number of the run: frequencies [rad/s]; amplitude [1].
REMNANT, NOISE = [1.1, 1.9, 3.1, 4.7, 7.3, 9.7], 0.003
PROTOCOL = """
title = "Steps"
order = "given"
[training]
least = 1
most = 1
[[task]]
kind = "step"
target = 10
seconds = 6
runs = 3
"""
SIZES = [(390, 844), (844, 390), (800, 600), (1400, 900)]

# A gamepad whose stick leans on the error and its rate, as they were LATE before; and the sockets, to drop one.
STICK = """
(() => {
  const pad = { id: "scripted stick", index: 0, connected: true, axes: [0], buttons: [{ pressed: false }], mapping: "" };
  navigator.getGamepads = () => [pad];
  window.sockets = [];
  const states = [];
  const wanted = [];
  const remnant = t => REMNANT.reduce((sum, w, k) => sum + NOISE * Math.sin(w * t + 2.4 * k + 1.7 * (window.phase?.run ?? 1) * (k + 1)), 0);
  const Native = WebSocket;
  window.WebSocket = class extends Native {
    constructor(...all) {
      super(...all);
      window.sockets.push(this);
      this.addEventListener("message", ({ data }) => {
        const message = JSON.parse(data);
        if (message.type === "phase") {
          window.phase = message;
          window.phases = (window.phases ?? 0) + 1;
        }
        if (message.type === "trouble") window.trouble = message.words;
        if (message.type !== "state") return;
        if (states.length && message.t < states.at(-1).t) states.length = wanted.length = 0;
        states.push(message);
        if (states.length > 4) states.shift();
        const [first, last] = [states[0], states.at(-1)];
        const rate = last.t > first.t ? (last.x[0] - first.x[0]) / (last.t - first.t) : 0;
        // Nothing before the start.
        const stick = GAIN * (last.target[0] - last.x[0] - LEAD * rate) + remnant(last.t);
        wanted.push([last.t, last.t === 0 ? 0 : Math.max(-1, Math.min(1, stick))]);
        while (wanted.length > 1 && wanted[1][0] <= last.t - LATE) wanted.shift();
        pad.axes[0] = wanted[0][1];
        window.state = last;
      });
    }
  };
})();
"""
for name in ("GAIN", "LEAD", "LATE", "REMNANT", "NOISE"):
    STICK = STICK.replace(name, str(globals()[name]))

LOOK = """
least => {
  const wrong = [];
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some(node => node.nodeType === 3 && node.data.trim());
    const box = element.getBoundingClientRect();
    if (!own || box.width === 0) continue;
    if (parseFloat(getComputedStyle(element).fontSize) < least) wrong.push(`small text: ${element.textContent}`);
    if (box.left < -1 || box.right > innerWidth + 1) wrong.push(`outside: ${element.textContent}`);
  }
  const canvas = document.querySelector("canvas");
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const pixels = copy.getImageData(0, 0, canvas.width, canvas.height).data;
  const colours = new Set();
  for (let k = 0; k < pixels.length; k += 4) colours.add(pixels[k] << 16 | pixels[k + 1] << 8 | pixels[k + 2]);
  if (colours.size < 5) wrong.push("nothing is drawn");
  return wrong;
}
"""


def shown(tab, folder, name, wrong):
    """Looks at what is shown in all sizes and both themes."""
    for theme in ("light", "dark"):
        tab.emulate_media(color_scheme=theme)
        for width, height in SIZES:
            tab.set_viewport_size({"width": width, "height": height})
            tab.wait_for_timeout(120)
            tab.screenshot(path=folder / f"{name}-{width}-{theme}.png")
            wrong += [f"{name}, {width} px, {theme}: {own}" for own in tab.evaluate(LOOK, LEAST)]


def phase(tab, kinds):
    """Waits for one of these phases."""
    tab.wait_for_function("kinds => kinds.includes(window.phase?.phase)", arg=kinds, timeout=60_000)
    return tab.evaluate("window.phase")


def flown(tab, folder, wrong):
    """Flies to the end; the results."""
    results, disturbed = [], ["reload", "drop"]
    flew = False
    for _ in range(30):
        now = phase(tab, ["ready", "after", "end"])
        if now["phase"] == "end":
            return results
        if flew and now["phase"] == "after":
            results.append(now["result"])
            if len(results) == 1:
                shown(tab, folder, "after", wrong)
            # On a busy machine a run may not count for a reason that is none of the page's.
            if len(results) >= 8:
                return results
        flew, heard = False, tab.evaluate("window.phases")
        tab.click("#go")
        try:
            # A countdown that is interrupted at once (a late frame is a stick that is gone) may pass between two looks.
            tab.wait_for_function("before => window.phases > before", arg=heard, timeout=5000)
        except TimeoutError:
            # The click came while the connection was down: a person presses once more.
            continue
        if phase(tab, ["fly", "ready", "after", "end"])["phase"] != "fly":
            continue
        flew = True
        tab.wait_for_function("() => window.state?.t > 2 || window.phase.phase !== 'fly'", timeout=20_000)
        if not results:
            shown(tab, folder, "fly", wrong)
        elif not now["training"] and disturbed:
            if disturbed.pop(0) == "reload":
                tab.reload()
                tab.wait_for_function("() => window.phase")
                tab.wait_for_selector("#welcome", state="hidden")
                # The stick is chosen again.
                tab.evaluate("document.getElementById('device').value = [...document.getElementById('device').options].findIndex(own => own.text === 'scripted stick')")
                tab.evaluate("document.getElementById('device').onchange()")
            else:
                tab.evaluate("window.sockets.at(-1).close()")
        phase(tab, ["after", "end"])
    return results


HOSTILE = "<img src=x onerror=document.title='ran-'+location.search>"


def joined(flights):
    """A second person with the flights of the first, whose code is a script."""
    for k, flight in enumerate(sorted(flights.glob("P1-*.csv"))):
        text = flight.read_text().replace("# subject: P1", f"# subject: {HOSTILE}")
        (flights / f"{HOSTILE}-step-10-{k}.csv").write_text(text)


def compared(tab):
    """What is wrong with the comparison of two people, the code of one of whom is a script."""
    tab.click("#jobs button:has-text('Compare')")
    tab.wait_for_selector("#job a[href*='compare.html']", timeout=120_000)
    with tab.expect_popup() as opened:
        tab.click("#job a[href*='compare.html']")
    page = opened.value
    page.wait_for_load_state("networkidle")
    wrong = [f"a frame of {page.title()}"] if len(page.frames) != 3 else []
    for frame in page.frames[1:]:
        frame.wait_for_selector("figure canvas")
    # A title may quote the code; one that a script made begins with its word.
    if any(frame.title().startswith("ran-") for frame in page.frames) or HOSTILE not in page.inner_text("body"):
        wrong.append(f"a script in a code ran: {page.content()}")
    # Markup that slips into a page all the same: its policy lets no script of it run.
    for target in [page, page.frames[1]]:
        target.evaluate("html => document.body.insertAdjacentHTML('beforeend', html)", HOSTILE)
        page.wait_for_timeout(200)
        if target.title().startswith("ran-"):
            wrong.append(f"the policy lets a script run: {target.url}")
    page.close()
    return wrong


def main():
    pilotage, browsers, folder = map(pathlib.Path, sys.argv[1:])
    browser = found(browsers)
    if browser is None:
        print("no browser")
        return
    (folder / "protocol.toml").write_text(PROTOCOL)
    command = [pilotage, "fly", "--protocol", "protocol.toml", "--no-browser", "-o", "flights"]
    server = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    try:
        address = server.stderr.readline().split()[-1]
        wrong = []
        with sync_playwright() as playwright:
            opened = launched(playwright.chromium, browser)
            tab = opened.new_page(viewport={"width": 800, "height": 600})
            tab.on("console", lambda message: message.type in ("error", "warning") and wrong.append(message.text))
            tab.on("pageerror", lambda error: wrong.append(str(error)))
            tab.add_init_script(STICK)
            tab.goto(address)
            tab.wait_for_selector("#welcome:visible")
            shown(tab, folder, "welcome", wrong)
            tab.set_viewport_size({"width": 800, "height": 600})
            tab.select_option("#device", label="scripted stick")
            tab.check("#consent")
            tab.click("#welcome .go")
            results = flown(tab, folder, wrong)
            # On a busy machine frames are late, and it may be that no run counts: there is nobody to identify then.
            if any((folder / "flights").glob("*.csv")):
                # What the page offers is looked up at the end of a job.
                joined(folder / "flights")
                tab.click("#jobs button:has-text('Identify me')")
                tab.wait_for_selector("#job .verdict", timeout=180_000)
                wrong += compared(tab)
            opened.close()
        print("\n".join(wrong) or json.dumps(results))
    finally:
        server.terminate()
        server.wait(10)


if __name__ == "__main__":
    main()
