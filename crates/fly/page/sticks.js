// What the hand holds: each device gives deflections of -1 to 1, to the right and up. Of a vehicle with two axes the first is
// forward, which is up.

const RISE = 1 / 300, FALL = 1 / 200; // of the keyboard [1/ms]
const REACH = 0.25; // of the window, for full deflection of mouse and thumb
const USED = 0.1; // what of an axis is no rest

const limited = value => Math.max(-1, Math.min(1, value));

// What this tab keeps over a reload; nothing where the browser keeps nothing.
export function remember(key, value) {
  try { sessionStorage.setItem(key, JSON.stringify(value)); } catch { /* then not */ }
}

export function remembered(key) {
  try { return JSON.parse(sessionStorage.getItem(key)); } catch { return null; }
}

// A mouse, whose centre is where its run began, or a finger, whose centre is where it came down. While it rests, before a run,
// the centre goes with it.
class Pointer {
  constructor(element, axes, type) {
    Object.assign(this, { type, name: type, axes, values: new Array(axes).fill(0), at: null, place: null, finger: null, rests: false });
    this.others = new Map(); // other fingers that are down, and where
    this.measure();
    if (type === "mouse") {
      addEventListener("pointermove", event => event.pointerType === "mouse" && this.move(event));
      return;
    }
    element.addEventListener("pointerdown", event => {
      if (event.pointerType === "mouse") return;
      element.setPointerCapture(event.pointerId);
      if (this.finger !== null) return this.others.set(event.pointerId, event);
      this.hold(event);
    });
    element.addEventListener("pointermove", event => {
      if (event.pointerId === this.finger) this.move(event);
      else if (this.others.has(event.pointerId)) this.others.set(event.pointerId, event);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      element.addEventListener(end, event => {
        this.others.delete(event.pointerId);
        if (event.pointerId !== this.finger) return;
        this.finger = this.place = null;
        this.centre();
        // The finger that is still down goes on, from where it is.
        const [other] = this.others.values();
        if (other) this.hold(other);
      });
    }
  }

  hold(event) {
    this.others.delete(event.pointerId);
    this.finger = event.pointerId;
    this.measure();
    this.move(event);
  }

  // Full deflection stays what it is while the window is turned or resized.
  measure() { this.reach = REACH * Math.min(innerWidth, 2 * innerHeight); }

  move({ clientX, clientY }) {
    this.place = [clientX, clientY];
    if (this.rests) this.at = this.place;
    this.at ??= this.place;
    const moved = [(clientX - this.at[0]) / this.reach, (this.at[1] - clientY) / this.reach];
    this.values = moved.slice(0, this.axes).map(limited);
  }

  centre() {
    this.at = this.place;
    this.values.fill(0);
    this.measure();
  }

  read() { return this.values; }
}

class Keyboard {
  constructor(axes) {
    Object.assign(this, { type: "keyboard", name: "arrow keys", values: new Array(axes).fill(0), held: new Set(), last: 0, rests: false });
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
    if (this.rests) this.centre();
    else this.follow(passed);
    return this.values;
  }

  follow(passed) {
    const wanted = [["ArrowRight", "ArrowLeft"], ["ArrowUp", "ArrowDown"]].map(([more, less]) => this.held.has(more) - this.held.has(less));
    this.values = this.values.map((value, axis) => {
      const step = (wanted[axis] ? RISE : FALL) * passed;
      return value + Math.max(-step, Math.min(step, wanted[axis] - value));
    });
  }

  centre() { this.values.fill(0); }
}

// A gamepad as browsers know it, with an axis, a rest and its way to each end for each axis of the vehicle.
class Gamepad {
  constructor(name, index, axes) {
    Object.assign(this, { type: "gamepad", name, index, dead: 0 });
    this.map = Array.from({ length: axes }, (_, k) => ({ axis: k, invert: k === 1, centre: 0, range: [1, 1] }));
  }

  // Null while it is not there.
  pad() {
    const pad = navigator.getGamepads?.()[this.index];
    const is_one = pad?.connected && pad.id === this.name && this.map.every(own => Number.isFinite(pad.axes[own.axis] ?? 0));
    return is_one ? pad : null;
  }

  raw(axis) { return this.pad()?.axes[axis] ?? 0; }

  read() {
    if (!this.pad()) return null;
    return this.map.map(({ axis, invert, centre, range }) => {
      const off = this.raw(axis) - centre, value = off / range[off < 0 ? 0 : 1] * (invert ? -1 : 1);
      // Beyond the dead zone it begins at 0.
      const beyond = Math.max(0, Math.abs(value) - this.dead) / (1 - this.dead);
      return limited(Math.sign(value) * beyond);
    });
  }

  // One that is not there counts as pressed, so that the press by which it comes starts nothing.
  pressed() { return this.pad()?.buttons.some(button => button.pressed) ?? true; }

  rest() { for (const own of this.map) own.centre = this.raw(own.axis); }

  // Between the calls the stick is moved to its ends; the second one tells which axes were.
  watch() {
    const seen = this.map.map(own => [this.raw(own.axis), this.raw(own.axis)]);
    const look = () => this.map.forEach((own, k) => {
      const value = this.raw(own.axis);
      seen[k] = [Math.min(seen[k][0], value), Math.max(seen[k][1], value)];
    });
    const timer = setInterval(look, 8);
    return () => {
      clearInterval(timer);
      return this.map.map((own, k) => {
        const [least, most] = seen[k];
        if (most - least < USED) return false;
        const ways = [own.centre - least, most - own.centre];
        // An end that was not reached is as far as the other one.
        own.range = ways.map((way, k) => way < USED / 2 ? ways[1 - k] : way);
        return true;
      });
    };
  }

  // In the order of the stick.
  calibration() {
    const of = key => this.map.map(own => own[key]).reverse();
    return { axis: of("axis"), invert: of("invert"), centre: of("centre"), range: of("range"), dead: this.dead };
  }

  centre() {}
}

// One that the server reads: the states tell where it is.
class Joystick extends Gamepad {
  constructor({ name, reading }, axes) {
    super(name, -1, axes);
    const { axis, invert, centre, range, dead } = reading;
    Object.assign(this, { type: "joystick", dead, state: null });
    this.map = axis.map((own, k) => ({ axis: own, invert: invert[k], centre: centre[k], range: range[k] })).reverse();
  }

  pad() { return this.state?.raw ? { axes: this.state.raw, buttons: [] } : null; }

  // Its buttons are not read.
  pressed() { return false; }
}

export class Sticks {
  // `come` is called when devices come or go, `change` when another one is chosen or it is read in another way; `joystick` is
  // what the server reads, if it does.
  constructor(element, axes, joystick, come, change) {
    Object.assign(this, { axes, come, change });
    if (joystick) {
      const own = new Joystick(joystick, axes);
      this.all = [own];
      this.chosen = own;
      this.again(own, remembered("stick") ?? {});
      return;
    }
    this.all = [new Pointer(element, axes, "mouse"), new Keyboard(axes)];
    if (navigator.maxTouchPoints > 0) this.all.push(new Pointer(element, axes, "touch"));
    const usual = matchMedia("(pointer: coarse)").matches && this.all[2] ? this.all[2] : this.all[0];
    this.chosen = this.before() ?? usual;
    addEventListener("gamepadconnected", () => this.look());
  }

  // The device from before a reload; a gamepad is taken for one that is not there yet.
  before() {
    const kept = remembered("stick") ?? {};
    if (kept.type !== "gamepad") return this.all.find(device => device.type === kept.type);
    const own = new Gamepad(kept.name, -1, this.axes);
    this.again(own, kept);
    this.all.push(own);
    return own;
  }

  // It is read as it was before a reload.
  again(own, { type, name, map, dead }) {
    const is_same = type === own.type && name === own.name;
    if (is_same && map?.length === this.axes && map.every(one => one.range?.length === 2)) Object.assign(own, { map, dead });
  }

  // What the server says of its joystick.
  hear(state) {
    if (this.chosen.type === "joystick") this.chosen.state = state;
  }

  choose(device) {
    if (!device) return;
    this.chosen = device;
    this.keep();
  }

  // The chosen device, and how it is read, hold from now on.
  keep() {
    const { type, name, map, dead } = this.chosen;
    remember("stick", { type, name, map, dead });
    this.change();
  }

  // Whether the chosen one is not there.
  get lost() { return this.chosen.pad?.() === null; }

  // Gamepads come and go.
  look() {
    const known = this.all.filter(device => device.type === "gamepad");
    const pads = this.chosen.type === "joystick" ? [] : navigator.getGamepads?.() ?? [];
    for (const pad of pads) {
      if (!pad?.connected || known.some(device => device.index === pad.index && device.name === pad.id)) continue;
      const back = known.find(device => device.name === pad.id && !device.pad());
      if (back) back.index = pad.index;
      else this.all.push(new Gamepad(pad.id, pad.index, this.axes));
    }
    const there = this.all.map(device => device.pad?.() !== null).join();
    if (there !== this.there) {
      this.there = there;
      this.come();
    }
  }

  // Before a run nothing that a mouse, a finger or a key does is a deflection.
  rest(rests) {
    for (const device of this.all) device.rests = rests;
    if (rests) this.chosen.centre();
  }

  read(now) {
    const values = this.chosen.read(now);
    return values
      ? { stick: values.toReversed(), device: this.chosen.type, name: this.chosen.name }
      : { stick: new Array(this.axes).fill(0), device: "none", name: this.chosen.name };
  }
}
