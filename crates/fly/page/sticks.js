// What the hand holds: each device gives deflections of -1 to 1, to the right and up. Of a vehicle with two axes the first is
// forward, which is up.

const RISE = 1 / 300, FALL = 1 / 200; // of the keyboard [1/ms]
const REACH = 0.25; // of the window, for full deflection of mouse and thumb
const USED = 0.05; // what of an axis is no rest

const limited = value => Math.max(-1, Math.min(1, value));

class Pointer {
  constructor(element, axes, type) {
    Object.assign(this, { type, name: type, axes, values: new Array(axes).fill(0), at: null });
    const from = type === "mouse" ? "pointermove" : "pointerdown";
    const own = event => (type === "mouse") === (event.pointerType === "mouse");
    element.addEventListener(from, event => {
      if (!own(event)) return;
      // Where a thumb comes down is its rest; a mouse rests where its run began.
      if (type === "touch") { this.at = [event.clientX, event.clientY]; element.setPointerCapture(event.pointerId); }
      this.move(event);
    });
    if (type === "touch") {
      element.addEventListener("pointermove", event => own(event) && this.at && this.move(event));
      for (const end of ["pointerup", "pointercancel"]) element.addEventListener(end, event => own(event) && this.centre());
    }
  }

  move({ clientX, clientY }) {
    this.place = [clientX, clientY];
    this.at ??= [clientX, clientY];
    const reach = REACH * Math.min(innerWidth, 2 * innerHeight);
    const moved = [(clientX - this.at[0]) / reach, (this.at[1] - clientY) / reach];
    this.values = moved.slice(0, this.axes).map(limited);
  }

  centre() {
    this.at = this.type === "mouse" ? this.place ?? null : null;
    this.values.fill(0);
  }

  read() { return this.values; }
}

class Keyboard {
  constructor(axes) {
    Object.assign(this, { type: "keyboard", name: "arrow keys", values: new Array(axes).fill(0), held: new Set(), last: 0 });
    addEventListener("keydown", event => {
      if (!event.key.startsWith("Arrow") || event.target.closest("input, select")) return;
      event.preventDefault();
      this.held.add(event.key);
    });
    addEventListener("keyup", event => this.held.delete(event.key));
    addEventListener("blur", () => this.held.clear());
  }

  read(now) {
    const passed = Math.min(now - this.last, 100);
    this.last = now;
    const wanted = [["ArrowRight", "ArrowLeft"], ["ArrowUp", "ArrowDown"]].map(([more, less]) => this.held.has(more) - this.held.has(less));
    this.values = this.values.map((value, axis) => {
      const step = (wanted[axis] ? RISE : FALL) * passed;
      return value + Math.max(-step, Math.min(step, wanted[axis] - value));
    });
    return this.values;
  }

  centre() { this.values.fill(0); }
}

// A gamepad as browsers know it, with an axis, a rest and ends for each axis of the vehicle.
class Gamepad {
  constructor(pad, axes) {
    Object.assign(this, { type: "gamepad", name: pad.id, index: pad.index, dead: 0 });
    this.map = Array.from({ length: axes }, (_, k) => ({ axis: k, invert: k === 1, centre: 0, range: 1 }));
  }

  pad() { return navigator.getGamepads?.()[this.index] ?? null; }

  raw(axis) { return this.pad()?.axes[axis] ?? 0; }

  read() {
    if (!this.pad()?.connected) return null;
    return this.map.map(({ axis, invert, centre, range }) => {
      const value = (this.raw(axis) - centre) / range;
      return Math.abs(value) <= this.dead ? 0 : limited(invert ? -value : value);
    });
  }

  pressed() { return this.pad()?.buttons.some(button => button.pressed) ?? false; }

  rest() { for (const own of this.map) own.centre = this.raw(own.axis); }

  // Between the calls the stick is moved to its ends.
  watch() {
    const most = this.map.map(() => 0);
    const timer = setInterval(() => this.map.forEach((own, k) => { most[k] = Math.max(most[k], Math.abs(this.raw(own.axis) - own.centre)); }), 8);
    return () => {
      clearInterval(timer);
      this.map.forEach((own, k) => { if (most[k] > USED) own.range = most[k]; });
    };
  }

  calibration() {
    const of = key => this.map.map(own => own[key]);
    return { axis: of("axis"), invert: of("invert"), centre: of("centre"), range: of("range"), dead: this.dead };
  }

  centre() {}
}

export class Sticks {
  constructor(element, axes, changed) {
    this.axes = axes;
    this.all = [new Pointer(element, axes, "mouse"), new Keyboard(axes)];
    if (navigator.maxTouchPoints > 0) this.all.push(new Pointer(element, axes, "touch"));
    this.chosen = matchMedia("(pointer: coarse)").matches && this.all[2] ? this.all[2] : this.all[0];
    this.changed = changed;
    addEventListener("gamepadconnected", () => this.look());
  }

  // Gamepads that are there and are not yet known.
  look() {
    const known = new Set(this.all.map(device => device.index));
    const found = [...(navigator.getGamepads?.() ?? [])].filter(pad => pad?.connected && !known.has(pad.index));
    if (!found.length) return;
    this.all.push(...found.map(pad => new Gamepad(pad, this.axes)));
    this.changed();
  }

  read(now) {
    const values = this.chosen.read(now);
    return values
      ? { stick: values.toReversed(), device: this.chosen.type, name: this.chosen.name }
      : { stick: new Array(this.axes).fill(0), device: "none", name: this.chosen.name };
  }
}
