#!/bin/sh
# From recorded flights to a height-velocity map with that pilot in the loop, in the folder `hv-example`. docs/hv.md explains it.
# The flights are of a synthetic human on a vehicle that follows the stick; take your own instead.
set -eu
mkdir hv-example
cd hv-example
pilotage trials synth --vehicle integrator --target sines --runs 3 --duration 60 -o flights
pilotage init flights/*.csv --pilot crossover --vehicle integrator -o task.toml
pilotage fit task.toml -o pilot.toml
pilotage hv --pilot pilot.toml --delay 0.3 --speeds 0:15:3 --heights 2:100:12 -o map
pilotage hv --pilot pilot.toml --delay 0.3 --at 9:15 -o landing
