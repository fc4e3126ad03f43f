// What stands in words: who flies, what to do, what came of it.

const $ = id => document.getElementById(id);
const JOBS = { identify: "Identify me", export: "Export as FMU", against: "Fly against my model", compare: "Compare people" };

export class Panel {
  constructor(say) {
    this.say = say;
    this.can = [];
    this.recorded = [];
    $("go").onclick = () => say({ type: "go" });
    $("take").onclick = () => say({ type: "take" });
  }

  hello({ vehicle, protocol, can, recorded, folder }) {
    Object.assign(this, { vehicle, protocol, can, folder, recorded: recorded.slice() });
    $("title").textContent = vehicle.name;
    $("what").textContent = `Fly the ${vehicle.name}`;
    $("how").textContent = `${protocol.title}. ${vehicle.axes.length > 1 ? "Up is forward" : "To the right is forward"}.`;
    $("consent-words").textContent = protocol.consent;
    document.title = `pilotage fly: ${vehicle.name}`;
    this.list();
  }

  // Shows one part of the card, or none.
  show(part) {
    for (const id of ["welcome", "pause", "taken"]) $(id).hidden = id !== part;
    if (part === "pause") $("go").focus({ preventScroll: true });
  }

  phase({ phase, task, run, of, training, words, seconds, result }) {
    const own = this.protocol.tasks[task];
    const count = of ? `run ${run} of ${of}` : `training ${run}`;
    $("run").textContent = phase === "welcome" || phase === "end" ? "" : `${own.title}, ${training ? `training ${run}` : count}`;
    $("count").textContent = phase === "countdown" ? seconds : "";
    $("left").textContent = "";
    if (phase === "welcome") return this.show("welcome");
    if (phase === "countdown" || phase === "fly") {
      document.activeElement?.blur();
      return this.show(null);
    }
    $("heading").textContent = phase === "end" ? "Done" : phase === "after" ? (result.valid ? "Well flown" : "Once more") : own.title;
    $("words").textContent = words;
    $("go").hidden = phase === "end";
    $("go").firstChild.data = phase === "after" ? "Go on " : "Fly ";
    $("score").hidden = !result;
    if (result) this.result(result, own);
    this.jobs();
    this.show("pause");
  }

  result({ rms, unit, score, valid, why, best, file }, task) {
    const number = document.createElement("b");
    number.textContent = score;
    $("score").replaceChildren(number, ` of 100. Distance to the marker ${rms.toPrecision(3)} ${unit} (rms), best so far ${best.toPrecision(3)} ${unit}.`);
    this.recorded.push({ file, task: task.name, rms, valid, why });
    this.list();
  }

  list() {
    $("list").hidden = this.recorded.length === 0;
    $("rows").replaceChildren(...this.recorded.map(({ file, rms, valid, why }) => {
      const row = document.createElement("tr");
      row.className = valid ? "" : "invalid";
      for (const text of [file, rms.toPrecision(3), valid ? "counts" : why]) row.insertCell().textContent = text;
      return row;
    }));
  }

  jobs() {
    const buttons = this.can.map(kind => {
      const button = document.createElement("button");
      button.textContent = JOBS[kind];
      button.onclick = () => this.say({ type: "job", kind });
      return button;
    });
    $("jobs").replaceChildren(...buttons);
  }

  job({ kind, state, words, link }) {
    const told = [`${JOBS[kind]}: ${state === "failed" ? "not done, " : ""}${words} `];
    if (link) {
      const anchor = document.createElement("a");
      anchor.href = `${link}${location.search}`;
      anchor.target = "_blank";
      anchor.textContent = "look at it";
      told.push(anchor);
    }
    $("job").replaceChildren(...told);
  }

  trouble(words) {
    $("trouble").textContent = words;
    $("trouble").hidden = !words;
    clearTimeout(this.timer);
    if (words) this.timer = setTimeout(() => this.trouble(""), 8000);
  }

  left(seconds) { $("left").textContent = `${Math.max(seconds, 0).toFixed(1)} s`; }

  // The form of the welcome: devices as they come, and the stick that moves.
  devices(sticks) {
    const menu = $("device");
    menu.replaceChildren(...sticks.all.map((device, k) => new Option(device.type === "gamepad" ? device.name : `${device.type}`, k)));
    menu.value = sticks.all.indexOf(sticks.chosen);
    menu.onchange = () => {
      sticks.chosen = sticks.all[menu.value];
      this.calibrate(sticks.chosen);
    };
    this.calibrate(sticks.chosen);
  }

  calibrate(device) {
    $("calibration").hidden = device.type !== "gamepad";
    if (device.type !== "gamepad") return;
    const own = device.map[0], count = device.pad()?.axes.length ?? 1;
    $("axis").replaceChildren(...Array.from({ length: count }, (_, k) => new Option(`${k + 1}`, k)));
    $("axis").value = own.axis;
    $("axis").onchange = () => { own.axis = Number($("axis").value); };
    $("invert").checked = own.invert;
    $("invert").onchange = () => { own.invert = $("invert").checked; };
    $("centre").onclick = () => device.rest();
    $("range").onclick = () => {
      $("measured").value = " move it to both ends";
      const end = device.watch();
      setTimeout(() => { end(); $("measured").value = ` ends at ±${own.range.toFixed(2)}`; }, 3000);
    };
  }

  bar(value) { $("bar").style.translate = `${value * ($("bar").parentElement.clientWidth / 2 - 8)}px`; }

  patch(on) { $("patch").classList.toggle("on", on); }
}
