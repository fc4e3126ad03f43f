// What stands in words: who flies, what to do, what came of it.

const $ = id => document.getElementById(id);
const JOBS = { identify: "Identify me", export: "Export as FMU", against: "Fly against my model", compare: "Compare people" };
// Why a run did not count that a faster computer would have saved, and how many in a row there are before advice is given.
const SLOW = ["nothing came from the page", "frames", "the simulation was late"], OFTEN = 2;
const MEASURED = 3000; // for how long the ends of a stick are looked for [ms]
const DEVICES = { mouse: "mouse", keyboard: "arrow keys", touch: "finger" };
const HIDDEN = "A gamepad or joystick stands in this menu once you press one of its buttons.";
const USE = {
  mouse: `Its way from where it is at the start pushes the stick. ${HIDDEN}`,
  keyboard: `Hold them to push the stick. ${HIDDEN}`,
  touch: "Put it down anywhere on the picture, then slide it.",
  gamepad: "Let go, and set its middle; then measure its ends. Each of its buttons starts the next run.",
  joystick: "The program reads it itself. Let go, and set its middle; then measure its ends.",
};
const HINTS = {
  mouse: "Move the mouse to the middle of the window: it counts from the start.",
  keyboard: "Fingers on the arrow keys: they count from the start.",
  touch: "Put your finger on the picture: it counts from the start.",
  gamepad: "Let go of the stick until it starts.",
  joystick: "Let go of the stick until it starts.",
};

function element(tag, text, kind = "") {
  const own = document.createElement(tag);
  own.textContent = text;
  own.className = kind;
  return own;
}

export class Panel {
  constructor(say) {
    this.say = say;
    this.can = [];
    this.recorded = [];
    this.part = null;
  }

  hello({ vehicle, protocol, can, recorded, folder, notes, joystick }) {
    Object.assign(this, { vehicle, protocol, can, folder, recorded: recorded.slice(), joystick: joystick?.name });
    const two = vehicle.axes.length > 1;
    $("title").textContent = vehicle.name;
    $("what").textContent = `Fly the ${vehicle.name}`;
    $("how").textContent = `${protocol.title}. ${two ? "Stick up: it flies forward. Stick to the right: it flies to the right." : "Stick to the right: it flies forward, to the right."}`;
    $("consent-words").textContent = protocol.consent;
    $("distance").textContent = `Distance [${vehicle.axes[0].unit}]`;
    $("bar").parentElement.classList.toggle("two", two);
    $("notes").hidden = !notes?.length;
    $("notes").replaceChildren(...(notes ?? []).map(note => element("li", note)));
    document.title = `pilotage fly: ${vehicle.name}`;
    this.works(null);
    this.list();
  }

  // Shows one part of the card, or none.
  show(part) {
    this.part = part;
    for (const id of ["welcome", "pause", "taken"]) $(id).hidden = id !== part;
    this.miss(this.missing);
    if (part === "pause") $("go").focus({ preventScroll: true });
  }

  phase({ phase, task, run, of, training, against, words, seconds, result }) {
    const own = this.protocol.tasks[task], runs = phase === "countdown" || phase === "fly";
    const count = against ? "against your model" : training || !of ? `training ${run}` : `run ${run} of ${of}`;
    $("run").textContent = phase === "welcome" || phase === "end" ? "" : `${own.title}, ${count}`;
    $("count").hidden = phase !== "countdown";
    $("seconds").textContent = seconds ?? "";
    $("left").textContent = "";
    $("stop").hidden = !runs;
    $(phase === "welcome" ? "welcome-stick" : "pause-stick").append($("stick"));
    if (phase === "welcome") return this.show("welcome");
    if (runs) {
      document.activeElement?.blur();
      if (!this.timer) $("job").hidden = true;
      return this.show(null);
    }
    const flown = result?.score >= 50 ? "Well flown" : "Flown";
    $("heading").textContent = phase === "end" ? "Done" : phase === "after" ? (result.valid ? flown : "Once more") : own.title;
    $("words").textContent = words;
    $("go").hidden = phase === "end";
    $("go").firstChild.data = phase === "after" ? "Go on " : "Fly ";
    $("score").hidden = !result?.valid;
    if (result) this.result(result, own, training);
    $("advice").hidden = phase !== "after" || this.slow() < OFTEN;
    this.jobs();
    this.show("pause");
  }

  result({ rms, unit, score, valid, why, best, file }, task, training) {
    const so = best === null ? "" : `, best so far ${best.toPrecision(3)} ${unit}`;
    if (valid) $("score").replaceChildren(element("b", score), ` of 100. Typical distance to the marker ${rms.toPrecision(3)} ${unit}${so}.`);
    // After a reload it is in the list already.
    if (this.recorded.some(own => own.file === file)) return;
    this.recorded.push({ file, task: task.name, rms, training, valid, why });
    this.list();
  }

  // How many runs, the last ones in a row, did not count because the computer was too slow.
  slow() {
    const fast = this.recorded.findLastIndex(({ why }) => !SLOW.some(words => why?.startsWith(words)));
    return this.recorded.length - 1 - fast;
  }

  list() {
    $("list").hidden = this.recorded.length === 0;
    $("rows").replaceChildren(...this.recorded.map(({ file, rms, training, valid, why }) => {
      const row = document.createElement("tr");
      row.className = valid ? "" : "invalid";
      for (const text of [file, valid ? rms.toPrecision(3) : "", !valid ? why : training ? "training" : "counts"]) row.insertCell().textContent = text;
      return row;
    }));
  }

  jobs() {
    const buttons = this.can.map(kind => {
      const button = element("button", JOBS[kind]);
      button.disabled = Boolean(this.timer);
      button.onclick = () => this.say({ type: "job", kind });
      return button;
    });
    $("jobs").replaceChildren(...buttons);
  }

  job({ kind, state, words, verdict, link }) {
    $("job").hidden = false;
    if (state === "running") return this.works(kind, words);
    this.works(null);
    const told = state === "failed" ? [element("p", `${JOBS[kind]}: not done`), element("p", words, "small")]
      : verdict ? [element("p", verdict, "verdict"), element("p", words, "small")]
      : [element("p", `${JOBS[kind]}: ${words}`)];
    if (link) {
      const anchor = element("a", link.endsWith(".fmu") ? "Keep the file" : "Look at it");
      anchor.href = `${link}${location.search}`;
      anchor.target = "_blank";
      told.splice(1, 0, anchor);
    }
    $("job").replaceChildren(...told);
    $("job").scrollIntoView({ block: "start" });
  }

  // A job goes on, or none does.
  works(kind, words) {
    if (kind) {
      this.since ??= performance.now();
      const line = element("p", "");
      const tell = () => { line.textContent = `${JOBS[kind]}: working ... ${Math.round((performance.now() - this.since) / 1000)} s`; };
      tell();
      clearInterval(this.timer);
      this.timer = setInterval(tell, 1000);
      $("job").replaceChildren(line, element("p", words, "small"));
    } else {
      clearInterval(this.timer);
      this.timer = this.since = null;
    }
    this.jobs();
  }

  // Something to read, for a while or until there is something else.
  trouble(words, stays = false) {
    $("trouble").textContent = words;
    $("trouble").hidden = !words;
    clearTimeout(this.told);
    if (words && !stays) this.told = setTimeout(() => this.trouble(""), 8000);
  }

  // The program has ended.
  over() {
    this.show(null);
    $("stop").hidden = true;
    $("count").hidden = true;
    $("left").textContent = "";
  }

  left(seconds) { $("left").textContent = `${Math.max(seconds, 0).toFixed(1)} s`; }

  // The chosen stick is not there: its name, or nothing.
  miss(name) {
    this.missing = name;
    $("missing").hidden = !name || !["welcome", "pause"].includes(this.part);
    $("missing").textContent = name ? (name === this.joystick ? `Plug in ${name}.` : `Plug in ${name} and press one of its buttons, or choose another stick.`) : "";
    $("go").disabled = Boolean(name);
    if (name) $("pause-stick").open = true;
  }

  // The menu of devices as they come and go.
  devices(sticks) {
    const menu = $("device");
    const name = device => DEVICES[device.type] ?? `${device.name}${device.pad() ? "" : " (not there)"}`;
    menu.replaceChildren(...sticks.all.map((device, k) => new Option(name(device), k)));
    menu.value = sticks.all.indexOf(sticks.chosen);
    menu.onchange = () => {
      sticks.choose(sticks.all[menu.value]);
      this.calibrate(sticks);
    };
    this.calibrate(sticks);
  }

  // How the chosen one is read.
  calibrate(sticks) {
    const device = sticks.chosen, { type, name, map } = device;
    $("held").textContent = DEVICES[type] ?? name;
    $("use").textContent = sticks.lost ? "" : USE[type];
    $("hint").textContent = HINTS[type];
    this.miss(sticks.lost ? name : null);
    $("calibration").hidden = !device.pad || sticks.lost;
    if ($("calibration").hidden) return;
    const ways = map.length > 1 ? ["Right", "Forward"] : ["Forward"];
    const count = Math.max(device.pad().axes.length, ...map.map(own => own.axis + 1));
    $("axes").replaceChildren(...map.map((own, k) => this.axis(ways[k], own, count, sticks)).reverse());
    $("dead").value = Math.round(100 * device.dead);
    $("dead").onchange = () => {
      device.dead = Math.max(0, Math.min(20, Number($("dead").value) || 0)) / 100;
      $("dead").value = Math.round(100 * device.dead);
      sticks.keep();
    };
    $("measured").value = "";
    $("centre").onclick = () => {
      device.rest();
      $("measured").value = "The middle is set.";
      sticks.keep();
    };
    $("range").onclick = () => {
      $("range").disabled = true;
      $("measured").value = "Move it to all its ends now.";
      const end = device.watch();
      setTimeout(() => {
        const moved = end();
        $("range").disabled = false;
        if (moved.includes(true)) sticks.keep();
        const told = map.map((own, k) => `${ways[k]}: ${moved[k] ? `from ${(own.centre - own.range[0]).toFixed(2)} to ${(own.centre + own.range[1]).toFixed(2)}` : "the stick did not move"}.`);
        if (sticks.chosen === device) $("measured").value = told.reverse().join(" ");
      }, MEASURED);
    };
  }

  // Which axis of the device leads one way, and whether it is turned round.
  axis(way, own, count, sticks) {
    const row = $("axis").content.cloneNode(true), menu = row.querySelector("select"), turned = row.querySelector("input");
    row.querySelector("span").textContent = way;
    menu.replaceChildren(...Array.from({ length: count }, (_, k) => new Option(`axis ${k + 1}`, k)));
    menu.value = own.axis;
    // Another axis has a middle and ends of its own.
    menu.onchange = () => {
      Object.assign(own, { axis: Number(menu.value), centre: 0, range: [1, 1] });
      $("measured").value = "Set its middle, and measure its ends.";
      sticks.keep();
    };
    turned.checked = own.invert;
    turned.onchange = () => { own.invert = turned.checked; sticks.keep(); };
    return row;
  }

  // Where the stick is: forward, and of two axes to the right.
  stick([first, right]) {
    if (!this.part) return;
    const { clientWidth, clientHeight } = $("bar").parentElement;
    const [x, y] = right === undefined ? [first, 0] : [right, -first];
    $("bar").style.translate = `${x * (clientWidth / 2 - 8)}px ${y * (clientHeight / 2 - 8)}px`;
  }

  patch(on) { $("patch").classList.toggle("on", on); }
}
