// The page of `pilotage fly`: what the hand does goes out once per frame, where the vehicle is comes in and is drawn.

import { Panel } from "./panel.js";
import { Scene, Track } from "./scene.js";
import { Socket } from "./socket.js";
import { Sticks, remember, remembered } from "./sticks.js";

const SHOWN = 100; // between two words on what was drawn [ms]
const PAUSES = ["ready", "after"], RUNS = ["countdown", "fly"];

const $ = id => document.getElementById(id);
const canvas = $("scene"), patch = new URLSearchParams(location.search).has("patch");
const scene = new Scene(canvas, patch), track = new Track();
let sticks = null, phase = { phase: "welcome" }, number = 0, before = performance.now(), told = 0, watches = false, pressed = true;
let drawn = null; // when the last frame was
let gone = false; // whether the program does not know this page any more
let untold = false; // whether the server has to hear what the hand holds

const socket = new Socket(hear, connected => {
  watches = false;
  if (!gone) panel.trouble(connected ? "" : "The connection is lost; it is tried again.", !connected);
}, () => {
  gone = true;
  panel.trouble("The program was started again: open the address that it shows now. This page is over.", true);
});
const panel = new Panel(message => socket.say(message));
$("patch").hidden = !patch;
$("subject").value = remembered("subject") ?? $("subject").value;

const heard = {
  hello(message) {
    panel.hello(message);
    sticks ??= new Sticks(canvas, message.vehicle.axes.length, message.joystick, () => panel.devices(sticks), () => { untold = true; });
    sticks.look();
    panel.devices(sticks);
    untold = true;
  },
  phase(message) {
    const begins = message.phase !== phase.phase || message.task !== phase.task;
    if (message.phase === "countdown" && phase.phase !== "countdown") panel.trouble("");
    phase = message;
    panel.phase(message);
    if (watches) watch();
    if (begins) scene.begin(panel.vehicle, panel.protocol.tasks[message.task]);
    sticks.rest(message.phase === "countdown");
    if (message.phase === "fly") sticks.chosen.centre();
  },
  state(message) {
    track.add(message, performance.now());
    sticks.hear(message);
  },
  job(message) { panel.job(message); },
  can({ can }) { panel.can = can; panel.jobs(); },
  trouble({ words }) { panel.trouble(words); },
  over({ words }) {
    gone = true;
    panel.trouble(words, true);
    panel.over();
  },
  taken() { watches = true; watch(); },
};

function hear(message) { heard[message.type]?.(message); }

// A page without the stick sees runs, and may take it.
function watch() { panel.show(RUNS.includes(phase.phase) ? null : "taken"); }

// Who flies, with what. The server hears it once more whenever that has changed.
function begin() {
  sticks.keep();
  untold = false;
  const subject = $("subject").value.trim();
  remember("subject", subject);
  socket.say({
    type: "begin",
    subject,
    consent: phase.phase !== "welcome" || $("consent").checked,
    device: sticks.chosen.type,
    calibration: sticks.chosen.calibration?.() ?? null,
    about: { browser: navigator.userAgent, screen: `${screen.width}x${screen.height} at ${devicePixelRatio}` },
  });
}

function go() {
  if (PAUSES.includes(phase.phase) && !sticks.lost) socket.say({ type: "go" });
}

$("go").addEventListener("click", go);
$("stop").addEventListener("click", () => socket.say({ type: "stop" }));
$("take").addEventListener("click", () => {
  socket.say({ type: "take" });
  watches = false;
  untold = true;
  panel.phase(phase);
});
$("welcome").addEventListener("submit", event => {
  event.preventDefault();
  begin();
});
addEventListener("keydown", ({ key, repeat, target }) => {
  if (repeat) return;
  if (key === "Escape" && RUNS.includes(phase.phase)) return socket.say({ type: "stop" });
  if (key === " " && !target.closest("input, select, button, a, summary")) go();
});

// The first button of a gamepad is Space.
function button() {
  const down = sticks.chosen.pressed?.() ?? false;
  if (down && !pressed) go();
  pressed = down;
}

function frame(now) {
  requestAnimationFrame(frame);
  const state = track.at(performance.now()), flies = state && phase.phase === "fly";
  if (sticks) {
    sticks.look();
    if (untold && !sticks.lost && !watches && [...PAUSES, "end"].includes(phase.phase)) begin();
    button();
    const read = sticks.read(now);
    panel.stick(read.stick);
    panel.patch(Math.abs(read.stick[0]) > 0.5);
    if (!watches) {
      number += 1;
      const seen = document.visibilityState === "visible" && document.hasFocus();
      socket.say({
        type: "input", n: number, t: performance.now(), ...read, frame: now - before, seen,
        drawn: flies ? state.time : null, drawn_at: drawn,
      });
    }
  }
  before = now;
  scene.draw(state);
  drawn = performance.now();
  if (flies) {
    panel.left(state.left);
    if (now - told > SHOWN && !watches) {
      told = now;
      socket.say({ type: "shown", t: state.t, seen: state.at, at: performance.now() });
    }
  }
}
requestAnimationFrame(frame);
