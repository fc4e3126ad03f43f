// What the person sees: the vehicle in its surroundings, or the displays of the human-machine field. One canvas.

const DELAY = 1.2; // states behind, so that there is mostly one on each side
const TOP = 46, BOTTOM = 96; // of the picture, where other things stand [px]
const ABOVE = 0.3; // height of a vehicle seen from behind, over the reach
const POLE = 0.6; // height of its marker

// The smallest round number that is not below: 1, 2 or 5 times a power of ten.
function round(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find(own => own * power >= 0.999 * rough);
}

// Moves from the last state but one to the last as time goes on, and a little beyond.
export class Track {
  constructor() { this.clear(); }

  clear() { this.states = []; this.gap = 8; }

  add(state, now) {
    const last = this.states.at(-1);
    // A run begins again.
    if (last && state.t < last.t) this.states = [];
    if (last) this.gap += 0.05 * (Math.min(now - last.now, 50) - this.gap);
    this.states.push({ ...state, now });
    if (this.states.length > 6) this.states.shift();
  }

  at(now) {
    const { states } = this;
    if (!states.length) return null;
    const first = { ...states[0], time: states[0].t };
    const time = now - DELAY * this.gap;
    let k = states.findLastIndex(state => state.now <= time);
    if (k === states.length - 1) k -= 1;
    if (k < 0) return first;
    const [a, b] = [states[k], states[k + 1]];
    const part = Math.max(0, Math.min(1.5, (time - a.now) / Math.max(b.now - a.now, 1)));
    const mix = key => a[key]?.map((value, i) => value + part * ((b[key]?.[i] ?? value) - value)) ?? [];
    return { ...b, time: a.t + part * (b.t - a.t), x: mix("x"), tilt: mix("tilt"), target: mix("target"), beside: b.beside ? mix("beside") : null };
  }
}

export class Scene {
  // With a patch the lower left corner is not free.
  constructor(canvas, patch) {
    this.canvas = canvas;
    this.g = canvas.getContext("2d");
    this.left = patch ? 44 : 20;
    this.camera = this.start = null;
    this.dark = matchMedia("(prefers-color-scheme: dark)");
  }

  colours() {
    return this.dark.matches
      ? { sky: ["#0d1620", "#1b2b39"], ground: "#17231c", ink: "#e8edf2", soft: "#8fa1b0", line: "#3a4a58", mark: "#ffb454", other: "#7bd6a5", body: "#e8edf2" }
      : { sky: ["#cfe1f0", "#f3f8fc"], ground: "#b9c9a9", ink: "#15202b", soft: "#4d5c69", line: "#a9b7c2", mark: "#b4540a", other: "#1b6e45", body: "#22303c" };
  }

  // Begins a task: the scale stays what it is.
  begin(vehicle, task) {
    this.vehicle = vehicle;
    this.task = task;
    this.reach = Math.max(task.reach, 4 * vehicle.size) || 1;
    this.camera = null;
  }

  draw(state) {
    const { canvas, g } = this, ratio = devicePixelRatio || 1;
    const [width, height] = [innerWidth, innerHeight];
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    Object.assign(this, { width, height, c: this.colours() });
    g.font = `${Math.max(12, Math.min(16, height / 45))}px system-ui, sans-serif`;
    if (!state?.x.length || !this.task) return this.sky();
    if (!this.start || state.t === 0) this.start = state.x;
    if (this.task.display === "compensatory") this.compensatory(state);
    else if (this.task.display === "pursuit") this.pursuit(state);
    else if (this.vehicle.view === "above") this.both(state);
    else this.side(state);
    this.hand(state.stick);
  }

  sky(horizon = this.height) {
    const { g, c, width, height } = this;
    const fill = g.createLinearGradient(0, 0, 0, horizon);
    fill.addColorStop(0, c.sky[0]);
    fill.addColorStop(1, c.sky[1]);
    g.fillStyle = fill;
    g.fillRect(0, 0, width, height);
    g.fillStyle = c.ground;
    g.fillRect(0, horizon, width, height - horizon);
  }

  // How far a place is from the target.
  far(place, { target }) { return Math.hypot(...target.map((own, k) => own - place[k])); }

  // Pixels per unit, and the place in the middle. Both stand still unless the vehicle leaves the picture, so that all that
  // moves is the vehicle.
  look(state) {
    const scale = 0.6 * this.width / this.reach, half = 0.42 * this.width / scale;
    if (this.camera === null || state.t === 0) this.camera = state.x[0] / 2 + state.target[0] / 2;
    const over = state.x[0] - this.camera;
    if (Math.abs(over) > half) this.camera += over - Math.sign(over) * half;
    return { scale, at: this.camera };
  }

  side(state) {
    const { c, width, height } = this;
    // On an upright phone the lower part is the card's.
    const horizon = (height > width ? 0.6 : 0.72) * height, { scale, at } = this.look(state);
    const px = x => width / 2 + (x - at) * scale;
    this.sky(horizon);
    this.ruler(horizon, scale, at, px);
    this.marker(px(state.target[0]), horizon, horizon - 0.42 * height);
    const size = Math.max(this.vehicle.size * scale, 34);
    const y = horizon - Math.max(0.22 * height, size);
    if (state.beside?.length) {
      this.craft(px(state.beside[0]), y, size, 0, c.other, 0.55);
      this.name(px(state.beside[0]), y - size / 2 - 6);
      this.edge([px(state.beside[0]), y], c.other, this.far(state.beside, state));
    }
    this.shadow(px(state.x[0]), horizon, 0.55 * size, 5);
    this.craft(px(state.x[0]), y, size, state.tilt[0] ?? 0, c.body, 1);
    this.edge([px(state.target[0]), height / 2], c.mark, this.far(state.x, state));
  }

  // Marks along the ground at round distances.
  ruler(y, scale, at, px) {
    const { g, c, width } = this, step = round(90 / scale);
    const unit = this.vehicle.axes[0].unit;
    g.strokeStyle = c.soft;
    g.fillStyle = c.soft;
    g.textAlign = "center";
    g.lineWidth = 1;
    const first = Math.ceil((at - width / 2 / scale) / step);
    for (let k = first; px(k * step) < width; k++) {
      const x = px(k * step), name = Number((k * step).toPrecision(6));
      g.beginPath();
      g.moveTo(x, y);
      g.lineTo(x, y + 8);
      g.stroke();
      g.fillText(k === 0 ? `0 ${unit}` : `${name}`, x, y + 26);
    }
  }

  // A pole with a flag, from its foot to its top.
  marker(x, y, top, size = 26) {
    const { g, c } = this;
    g.strokeStyle = g.fillStyle = c.mark;
    g.lineWidth = 2;
    g.setLineDash([6, 6]);
    g.beginPath();
    g.moveTo(x, y);
    g.lineTo(x, top);
    g.stroke();
    g.setLineDash([]);
    g.beginPath();
    g.moveTo(x, top);
    g.lineTo(x + size, top + 0.35 * size);
    g.lineTo(x, top + 0.7 * size);
    g.fill();
    g.beginPath();
    g.ellipse(x, y, 0.6 * size, 0.2 * size, 0, 0, 7);
    g.fill();
  }

  shadow(x, y, wide, tall) {
    this.g.fillStyle = this.dark.matches ? "#0009" : "#0003";
    this.g.beginPath();
    this.g.ellipse(x, y + 3, wide, tall, 0, 0, 7);
    this.g.fill();
  }

  // Whose the other vehicle is.
  name(x, y) {
    this.g.fillStyle = this.c.other;
    this.g.textAlign = "center";
    this.g.fillText("your model", x, y);
  }

  // A quadcopter from the side: body, arms, two rotors. A positive tilt leans to the right.
  craft(x, y, size, tilt, colour, opacity) {
    const { g } = this, s = size / 2;
    g.save();
    g.translate(x, y);
    g.rotate(tilt);
    g.globalAlpha = opacity;
    g.strokeStyle = g.fillStyle = colour;
    g.lineCap = "round";
    g.lineWidth = Math.max(3, s / 9);
    g.beginPath();
    g.moveTo(-s, 0);
    g.lineTo(s, 0);
    for (const end of [-s, s]) { g.moveTo(end, 0); g.lineTo(end, -s / 3); }
    g.stroke();
    g.beginPath();
    g.ellipse(0, s / 14, s / 3, s / 6, 0, 0, 7);
    g.fill();
    g.globalAlpha = 0.45 * opacity;
    for (const end of [-s, s]) {
      g.beginPath();
      g.ellipse(end, -s / 3, s / 1.8, s / 16, 0, 0, 7);
      g.fill();
    }
    g.restore();
  }

  // Two axes, forward and to the right: from behind, and from above.
  both(state) {
    const { g, c, width, height } = this;
    const wide = width > height, half = wide ? [width / 2, height] : [width, height / 2];
    const second = wide ? [half[0], 0] : [0, half[1]];
    this.within([0, 0, ...half], () => this.behind(state));
    this.within([...second, ...half], () => this.above(state, wide ? TOP : 0));
    g.strokeStyle = c.soft;
    g.lineWidth = 1;
    g.beginPath();
    g.moveTo(...second);
    g.lineTo(...(wide ? [half[0], height] : [width, half[1]]));
    g.stroke();
  }

  // Draws a part of the picture as if it were the whole.
  within([x, y, width, height], draw) {
    const { g } = this, whole = { width: this.width, height: this.height };
    g.save();
    g.beginPath();
    g.rect(x, y, width, height);
    g.clip();
    g.translate(x, y);
    Object.assign(this, { width, height });
    draw();
    Object.assign(this, whole);
    g.restore();
  }

  // In perspective, from behind the start and above it.
  behind(state) {
    const { g, c, width, height, reach } = this, [ahead, right] = this.start;
    const focal = Math.min(0.66 * width, 1.2 * (height - 2 * TOP));
    const horizon = Math.max(TOP, height / 2 - 0.38 * focal);
    // Pixels per unit at a place, and where it is; what is behind the eye is far below the picture.
    const near = place => focal / Math.max(place[0] - ahead + 2.4 * reach, 0.05 * reach);
    const at = (place, up = 0) => [width / 2 + (place[1] - right) * near(place), horizon + (reach - up) * near(place)];
    this.sky(horizon);
    this.grid((a, r) => at([ahead + a * reach, right + r * reach]), -1.9, 12, 3);
    const size = Math.max(this.vehicle.size, 0.4 * reach), high = ABOVE * reach;
    const all = [{ place: state.target, draw: () => this.marker(...at(state.target), at(state.target, POLE * reach)[1], Math.max(14, size * near(state.target))) }];
    const vehicle = (place, tilt, colour, opacity) => {
      const [x, y] = at(place), seen = size * near(place);
      this.shadow(x, y - 3, 0.5 * seen, 0.5 * seen * reach / (place[0] - ahead + 2.4 * reach));
      g.strokeStyle = colour;
      g.lineWidth = 1;
      g.setLineDash([2, 4]);
      g.beginPath();
      g.moveTo(x, y);
      g.lineTo(...at(place, high));
      g.stroke();
      g.setLineDash([]);
      this.solid((a, r, up) => at([place[0] + a * size / 2, place[1] + r * size / 2], high + up * size / 2), tilt, seen, colour, opacity);
      if (colour === c.other) this.name(x, at(place, high)[1] - seen / 2 - 4);
    };
    all.push({ place: state.x, draw: () => vehicle(state.x, state.tilt, c.body, 1) });
    if (state.beside?.length) all.push({ place: state.beside, draw: () => vehicle(state.beside, [], c.other, 0.55) });
    // What is farther away is behind; what is behind the eye is not seen.
    all.sort((a, b) => b.place[0] - a.place[0]);
    for (const { place, draw } of all) if (place[0] - ahead > -2.2 * reach) draw();
    this.edges(state, place => at(place, high));
    this.title("from behind", TOP);
  }

  // A quadcopter of arms and rotors, pitched and rolled: `at` tells where a point of it is on the picture.
  solid(at, [pitch = 0, roll = 0], seen, colour, opacity) {
    const { g } = this;
    // A positive pitch leans forward, a positive roll to the right.
    const point = (a, r) => at(a * Math.cos(pitch), r * Math.cos(roll), -a * Math.sin(pitch) - r * Math.sin(roll));
    g.save();
    g.globalAlpha = opacity;
    g.strokeStyle = g.fillStyle = colour;
    g.lineCap = "round";
    g.lineWidth = Math.max(2.5, seen / 14);
    g.beginPath();
    for (const side of [1, -1]) {
      g.moveTo(...point(-0.7, -0.7 * side));
      g.lineTo(...point(0.7, 0.7 * side));
    }
    g.stroke();
    g.globalAlpha = 0.5 * opacity;
    for (const [a, r] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
      g.beginPath();
      for (let k = 0; k < 16; k++) g.lineTo(...point(0.7 * a + 0.45 * Math.cos(k * Math.PI / 8), 0.7 * r + 0.45 * Math.sin(k * Math.PI / 8)));
      g.fill();
    }
    g.restore();
    g.fillStyle = colour;
    g.beginPath();
    g.arc(...point(0, 0), Math.max(2.5, seen / 9), 0, 7);
    g.fill();
  }

  // Squares on the ground, and which way is forward, as far as `far`, and to the right. Of all these 1 is the reach.
  grid(at, least, most, far) {
    const { g, c } = this, step = round(this.reach / 3) / this.reach, wide = 8;
    g.strokeStyle = c.soft;
    g.globalAlpha = 0.3;
    g.lineWidth = 1;
    g.beginPath();
    const line = (a, b) => { g.moveTo(...at(...a)); g.lineTo(...at(...b)); };
    for (let k = Math.ceil(least / step); k * step <= most; k++) line([k * step, -wide], [k * step, wide]);
    for (let k = -Math.floor(wide / step); k * step <= wide; k++) line([least, k * step], [most, k * step]);
    g.stroke();
    g.globalAlpha = 1;
    for (const [tip, back, words] of [[[far, 0], [-1.1, 0], "forward"], [[0, 1.15], [0, -1.1], "right"]]) {
      const [x, y] = at(...tip), [from, low] = at(...back);
      g.strokeStyle = g.fillStyle = c.soft;
      g.lineWidth = 2;
      g.beginPath();
      g.moveTo(from, low);
      g.lineTo(x, y);
      g.stroke();
      this.tip(x, y, Math.atan2(y - low, x - from), 6);
      g.textAlign = "right";
      g.fillText(words, ...(words === "right" ? [x + 4, y + 20] : [x - 10, y + 4]));
    }
  }

  // The point of an arrow.
  tip(x, y, angle, size) {
    const { g } = this;
    g.save();
    g.translate(x, y);
    g.rotate(angle);
    g.beginPath();
    g.moveTo(size, 0);
    g.lineTo(-size, 0.8 * size);
    g.lineTo(-size, -0.8 * size);
    g.fill();
    g.restore();
  }

  title(words, y) {
    const { g, c } = this;
    g.fillStyle = c.soft;
    g.textAlign = "left";
    g.fillText(words, 16, y + 20);
  }

  // From above.
  above(state, top) {
    const { c, width, height } = this, scale = 0.36 * Math.min(width, height - 2 * top) / this.reach;
    const at = this.map(scale);
    this.plain();
    this.grid((a, r) => at([this.start[0] + a * this.reach, this.start[1] + r * this.reach]), -8, 8, 1.25);
    this.ring(...at(state.target), 18, c.mark);
    const size = Math.max(this.vehicle.size * scale, 30);
    if (state.beside?.length) {
      this.rotors(...at(state.beside), size, c.other, 0.55);
      this.name(at(state.beside)[0], at(state.beside)[1] - size / 2 - 6);
    }
    this.rotors(...at(state.x), size, c.body, 1);
    this.edges(state, at);
    this.scaleBar(scale);
    this.title("from above", top);
  }

  // Where places are on a flat picture with the start in the middle: to the right what has one axis, else forward is up.
  map(scale) {
    const { width, height, start } = this;
    return place => {
      const [first, right] = place.map((own, k) => (own - start[k]) * scale);
      return right === undefined ? [width / 2 + first, height / 2] : [width / 2 + right, height / 2 - first];
    };
  }

  // Arrows to all that is outside.
  edges(state, at) {
    const { c } = this;
    this.edge(at(state.target), c.mark, this.far(state.x, state));
    if (state.beside?.length) this.edge(at(state.beside), c.other, this.far(state.beside, state));
    this.edge(at(state.x), c.body, this.far(state.x, state));
  }

  // An arrow at the edge to a place outside, and how far vehicle and marker are from each other.
  edge([x, y], colour, distance) {
    const { g, width, height } = this;
    if (x >= 0 && x <= width && y >= 0 && y <= height) return;
    const [dx, dy] = [x - width / 2, y - height / 2];
    const tall = dy > 0 ? height / 2 - BOTTOM : height / 2 - TOP - 14;
    const part = Math.min((width / 2 - 18) / Math.abs(dx), tall / Math.abs(dy));
    const [ex, ey] = [width / 2 + part * dx, height / 2 + part * dy];
    g.fillStyle = colour;
    this.tip(ex, ey, Math.atan2(dy, dx), 10);
    const side = Math.abs(ex - width / 2) < width / 4 ? 0 : Math.sign(dx);
    g.textAlign = ["right", "center", "left"][1 - side];
    const told = `${distance < 10 ? distance.toFixed(1) : Math.round(distance)} ${this.vehicle.axes[0].unit}`;
    g.fillText(told, ex - 18 * side, side ? ey + 5 : ey + (dy > 0 ? -18 : 28));
  }

  rotors(x, y, size, colour, opacity) {
    const { g } = this, s = size / 2.6;
    g.save();
    g.translate(x, y);
    g.globalAlpha = opacity;
    g.strokeStyle = g.fillStyle = colour;
    g.lineWidth = Math.max(3, s / 6);
    g.beginPath();
    for (const [a, b] of [[1, 1], [1, -1]]) { g.moveTo(-a * s, -b * s); g.lineTo(a * s, b * s); }
    g.stroke();
    g.globalAlpha = 0.4 * opacity;
    for (const [a, b] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
      g.beginPath();
      g.arc(a * s, b * s, s / 1.6, 0, 7);
      g.fill();
    }
    g.restore();
  }

  // The error alone: the cross, which is the vehicle, stands, and the dot, which is the target, moves.
  compensatory(state) {
    const { c, width, height } = this, least = Math.min(width, height), scale = 0.42 * least / this.span();
    const error = state.target.map((target, k) => (target - state.x[k]) * scale);
    const [right, ahead] = error.length > 1 ? [error[1], error[0]] : [error[0], 0];
    const place = [width / 2 + right, height / 2 - ahead];
    this.plain();
    this.cross(width / 2, height / 2, 0.45 * least, c.soft, 2);
    const rows = [[(x, y) => this.dot(x, y, 7), "target"], [(x, y) => this.cross(x, y, 7, c.soft, 2), "vehicle (stands still)"]];
    if (state.beside?.length) {
      // What the model sees of its own.
      const [first, second] = state.target.map((target, k) => (target - state.beside[k]) * scale);
      const [x, y] = second === undefined ? [first, 0] : [second, first];
      this.ring(width / 2 + x, height / 2 - y, 14, c.other);
      rows.push([(x, y) => this.ring(x, y, 7, c.other), "target as your model sees it"]);
    }
    this.dot(...place, 14);
    this.edge(place, c.mark, this.far(state.x, state));
    this.scaleBar(scale);
    this.legend(rows);
  }

  // Target and vehicle move on one scale.
  pursuit(state) {
    const { c, width, height } = this, room = state.x.length > 1 ? height - TOP : 1.6 * height;
    const scale = 0.4 * Math.min(width, room) / this.span(), at = this.map(scale);
    this.plain();
    this.cross(width / 2, height / 2, 0.48 * width, c.line, 1);
    this.ring(...at(state.target), 20, c.mark);
    if (state.beside?.length) this.cross(...at(state.beside), 10, c.other, 3);
    this.cross(...at(state.x), 14, c.ink, 3);
    this.edges(state, at);
    this.scaleBar(scale);
    const rows = [[(x, y) => this.ring(x, y, 7, c.mark), "target"], [(x, y) => this.cross(x, y, 7, c.ink, 3), "vehicle"]];
    if (state.beside?.length) rows.push([(x, y) => this.cross(x, y, 7, c.other, 3), "your model"]);
    this.legend(rows);
  }

  span() { return Math.max(this.task.reach, this.reach / 2); }

  plain() {
    this.g.fillStyle = this.c.sky[1];
    this.g.fillRect(0, 0, this.width, this.height);
  }

  cross(x, y, size, colour, thick) {
    const { g } = this;
    g.strokeStyle = colour;
    g.lineWidth = thick;
    g.beginPath();
    g.moveTo(x - size, y);
    g.lineTo(x + size, y);
    g.moveTo(x, y - Math.min(size, 0.45 * this.height));
    g.lineTo(x, y + Math.min(size, 0.45 * this.height));
    g.stroke();
  }

  ring(x, y, size, colour) {
    const { g } = this;
    g.strokeStyle = colour;
    g.lineWidth = 3;
    g.beginPath();
    g.arc(x, y, size, 0, 7);
    g.stroke();
  }

  dot(x, y, size) {
    const { g, c } = this;
    this.ring(x, y, size, c.mark);
    g.fillStyle = c.mark;
    g.beginPath();
    g.arc(x, y, size / 3, 0, 7);
    g.fill();
  }

  scaleBar(scale) {
    const { g, c, height, left } = this, size = round(60 / scale);
    g.strokeStyle = g.fillStyle = c.soft;
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(left, height - 34);
    g.lineTo(left + size * scale, height - 34);
    g.stroke();
    g.textAlign = "left";
    g.fillText(`${Number(size.toPrecision(3))} ${this.vehicle.axes[0].unit}`, left, height - 14);
  }

  // What the marks are, above the scale.
  legend(rows) {
    const { g, c, height, left } = this;
    for (const [k, [mark, words]] of rows.toReversed().entries()) {
      const y = height - 58 - 24 * k;
      mark(left + 8, y - 4);
      g.fillStyle = c.ink;
      g.textAlign = "left";
      g.fillText(words, left + 26, y);
    }
  }

  // The stick, small.
  hand(stick) {
    const { g, c, width, height } = this, size = 34, x = width - size - 18, y = height - (stick.length > 1 ? size : 14) - 16;
    g.strokeStyle = c.soft;
    g.lineWidth = 1;
    const tall = stick.length > 1 ? size : 8;
    g.strokeRect(x - size, y - tall, 2 * size, 2 * tall);
    g.fillStyle = c.mark;
    g.beginPath();
    const [right, ahead] = stick.length > 1 ? [stick[1], stick[0]] : [stick[0], 0];
    g.arc(x + right * size, y - ahead * tall, 6, 0, 7);
    g.fill();
  }
}
