// The page of `pilotage fly`: what the hand does goes out once per frame, where the vehicle is comes in and is drawn.

import { Panel } from "./panel.js";
import { Scene, Track } from "./scene.js";
import { Socket } from "./socket.js";
import { Sticks } from "./sticks.js";

const SHOWN = 100; // between two words on what was drawn [ms]

const canvas = document.getElementById("scene");
const scene = new Scene(canvas), track = new Track();
let sticks = null, phase = { phase: "welcome" }, number = 0, before = performance.now(), told = 0, watches = false, pressed = false;

const socket = new Socket(hear, connected => {
  watches = false;
  panel.trouble(connected ? "" : "The connection is lost; it is tried again.");
});
const panel = new Panel(message => socket.say(message));
document.getElementById("patch").hidden = !new URLSearchParams(location.search).has("patch");

const heard = {
  hello(message) {
    panel.hello(message);
    sticks ??= new Sticks(canvas, message.vehicle.axes.length, () => panel.devices(sticks));
    panel.devices(sticks);
  },
  phase(message) {
    const begins = message.phase !== phase.phase || message.task !== phase.task;
    phase = message;
    panel.phase(message);
    if (begins) scene.begin(panel.vehicle, panel.protocol.tasks[message.task]);
    if (message.phase === "fly") sticks.chosen.centre();
  },
  state(message) { track.add(message, performance.now()); },
  job(message) { panel.job(message); },
  can({ can }) { panel.can = can; panel.jobs(); },
  trouble({ words }) { panel.trouble(words); },
  taken() { watches = true; panel.show("taken"); },
};

function hear(message) { heard[message.type]?.(message); }

document.getElementById("take").addEventListener("click", () => { watches = false; panel.phase(phase); });
document.getElementById("welcome").addEventListener("submit", event => {
  event.preventDefault();
  socket.say({
    type: "begin",
    subject: document.getElementById("subject").value,
    consent: document.getElementById("consent").checked,
    device: sticks.chosen.type,
    calibration: sticks.chosen.calibration?.() ?? null,
  });
});
addEventListener("keydown", ({ key, repeat, target }) => {
  if (repeat || target.closest("input, select, button, a, summary")) return;
  if (key === " " && ["ready", "after"].includes(phase.phase)) socket.say({ type: "go" });
  if (key === "Escape" && ["countdown", "fly"].includes(phase.phase)) socket.say({ type: "stop" });
});

// The first button of a gamepad is Space.
function button() {
  const down = sticks.chosen.pressed?.() ?? false;
  if (down && !pressed && ["ready", "after"].includes(phase.phase)) socket.say({ type: "go" });
  pressed = down;
}

function frame(now) {
  requestAnimationFrame(frame);
  if (sticks) {
    sticks.look();
    button();
    const read = sticks.read(now);
    panel.bar(read.stick[0]);
    panel.patch(Math.abs(read.stick[0]) > 0.5);
    if (!watches) {
      number += 1;
      const seen = document.visibilityState === "visible" && document.hasFocus();
      socket.say({ type: "input", n: number, t: performance.now(), ...read, frame: now - before, seen });
    }
  }
  before = now;
  const state = track.at(performance.now());
  scene.draw(state);
  if (state && phase.phase === "fly") {
    panel.left(state.left);
    if (now - told > SHOWN && !watches) {
      told = now;
      socket.say({ type: "shown", t: state.t, seen: state.at, at: performance.now() });
    }
  }
}
requestAnimationFrame(frame);
