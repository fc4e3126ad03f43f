// What the person sees: the vehicle in its surroundings, or the displays of the human-machine field. One canvas.

const DELAY = 1.2; // states behind, so that there is mostly one on each side

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
    const time = now - DELAY * this.gap;
    let k = states.findLastIndex(state => state.now <= time);
    if (k < 0) return states[0];
    if (k === states.length - 1) k -= 1;
    if (k < 0) return states[0];
    const [a, b] = [states[k], states[k + 1]];
    const part = Math.max(0, Math.min(1.5, (time - a.now) / Math.max(b.now - a.now, 1)));
    const mix = key => a[key]?.map((value, i) => value + part * ((b[key]?.[i] ?? value) - value)) ?? [];
    return { ...b, x: mix("x"), tilt: mix("tilt"), target: mix("target"), beside: b.beside ? mix("beside") : null };
  }
}

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.g = canvas.getContext("2d");
    this.camera = null;
    this.dark = matchMedia("(prefers-color-scheme: dark)");
  }

  colours() {
    return this.dark.matches
      ? { sky: ["#0d1620", "#1b2b39"], ground: "#17231c", ink: "#e8edf2", soft: "#8fa1b0", line: "#3a4a58", mark: "#ffb454", other: "#7bd6a5", body: "#e8edf2" }
      : { sky: ["#cfe1f0", "#f3f8fc"], ground: "#b9c9a9", ink: "#15202b", soft: "#5a6a78", line: "#a9b7c2", mark: "#b4540a", other: "#1b6e45", body: "#22303c" };
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
    if (!state || !this.task) return this.sky();
    if (this.task.display === "compensatory") this.compensatory(state);
    else if (this.task.display === "pursuit") this.pursuit(state);
    else if (this.vehicle.view === "above") this.above(state);
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

  // Pixels per unit, and the place in the middle. Both stand still unless the vehicle leaves the picture, so that all that
  // moves is the vehicle.
  look(state) {
    const scale = 0.6 * this.width / this.reach, half = 0.42 * this.width / scale;
    this.camera ??= state.x[0] / 2 + state.target[0] / 2;
    const over = state.x[0] - this.camera;
    if (Math.abs(over) > half) this.camera += over - Math.sign(over) * half;
    return { scale, at: this.camera };
  }

  side(state) {
    const { g, c, width, height } = this;
    const horizon = 0.72 * height, { scale, at } = this.look(state);
    const px = x => width / 2 + (x - at) * scale;
    this.sky(horizon);
    this.ruler(horizon, scale, at, px);
    this.marker(px(state.target[0]), horizon);
    const size = Math.max(this.vehicle.size * scale, 34);
    const y = horizon - Math.max(0.22 * height, size);
    if (state.beside?.length) this.craft(px(state.beside[0]), y, size, 0, c.other, 0.55);
    this.shadow(px(state.x[0]), horizon, size);
    this.craft(px(state.x[0]), y, size, state.tilt[0] ?? 0, c.body, 1);
    g.textAlign = "left";
  }

  // Marks along the ground at round distances.
  ruler(y, scale, at, px) {
    const { g, c, width } = this;
    const rough = 90 / scale, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find(own => own * power >= rough);
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

  marker(x, y) {
    const { g, c } = this, top = y - 0.42 * this.height;
    g.strokeStyle = c.mark;
    g.lineWidth = 2;
    g.setLineDash([6, 6]);
    g.beginPath();
    g.moveTo(x, y);
    g.lineTo(x, top);
    g.stroke();
    g.setLineDash([]);
    g.fillStyle = c.mark;
    g.beginPath();
    g.moveTo(x, top);
    g.lineTo(x + 26, top + 9);
    g.lineTo(x, top + 18);
    g.fill();
    g.beginPath();
    g.ellipse(x, y, 16, 5, 0, 0, 7);
    g.fill();
  }

  shadow(x, y, size) {
    this.g.fillStyle = "#0003";
    this.g.beginPath();
    this.g.ellipse(x, y + 3, 0.55 * size, 5, 0, 0, 7);
    this.g.fill();
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

  // Two axes, forward and to the right, from above.
  above(state) {
    const { c, width, height } = this, scale = 0.38 * Math.min(width, height) / this.reach;
    const at = ([ahead, right]) => [width / 2 + right * scale, height / 2 - ahead * scale];
    this.plain();
    this.cross(width / 2, height / 2, 0.4 * Math.min(width, height), c.line, 1);
    this.ring(...at(state.target), 18, c.mark);
    const size = Math.max(this.vehicle.size * scale, 30);
    if (state.beside?.length) this.rotors(...at(state.beside), size, c.other, 0.55);
    this.rotors(...at(state.x), size, c.body, 1);
    this.scaleBar(scale);
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

  // The error alone: the cross stands, the dot moves.
  compensatory(state) {
    const { g, c, width, height } = this, scale = 0.42 * Math.min(width, height) / this.span();
    const error = state.target.map((target, k) => (target - state.x[k]) * scale);
    this.plain();
    this.cross(width / 2, height / 2, 0.45 * Math.min(width, height), c.soft, 2);
    const far = value => Math.max(-0.47, Math.min(0.47, value / Math.min(width, height))) * Math.min(width, height);
    const [right, ahead] = error.length > 1 ? [error[1], error[0]] : [error[0], 0];
    this.ring(width / 2 + far(right), height / 2 - far(ahead), 14, c.mark);
    g.fillStyle = c.mark;
    g.beginPath();
    g.arc(width / 2 + far(right), height / 2 - far(ahead), 5, 0, 7);
    g.fill();
    this.scaleBar(scale);
  }

  // Target and vehicle move on one scale.
  pursuit(state) {
    const { g, c, width, height } = this, scale = 0.4 * Math.min(width, 1.6 * height) / this.span();
    const at = ([first, right]) => right === undefined ? [width / 2 + first * scale, height / 2] : [width / 2 + right * scale, height / 2 - first * scale];
    this.plain();
    this.cross(width / 2, height / 2, 0.48 * width, c.line, 1);
    this.ring(...at(state.target), 20, c.mark);
    if (state.beside?.length) this.cross(...at(state.beside), 10, c.other, 3);
    this.cross(...at(state.x), 14, c.ink, 3);
    g.textAlign = "left";
    this.scaleBar(scale);
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

  scaleBar(scale) {
    const { g, c, height } = this, rough = 100 / scale, power = 10 ** Math.floor(Math.log10(rough));
    const size = power * [1, 2, 5, 10].findLast(own => own * power <= rough * 1.01);
    g.strokeStyle = g.fillStyle = c.soft;
    g.lineWidth = 2;
    g.beginPath();
    g.moveTo(20, height - 34);
    g.lineTo(20 + size * scale, height - 34);
    g.stroke();
    g.textAlign = "left";
    g.fillText(`${Number(size.toPrecision(3))} ${this.vehicle.axes[0].unit}`, 20, height - 14);
  }

  // The stick, small.
  hand(stick) {
    const { g, c, width, height } = this, size = 34, x = width - size - 18, y = height - (stick.length > 1 ? size : 14) - 16;
    g.strokeStyle = c.line;
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
