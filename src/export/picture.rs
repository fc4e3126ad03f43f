//! model.png: a picture that tools show on the model's block.

use crate::models::{Kind, Model, Simulation};
use pilotage_kit::{Interface, Role, Variable};
use tiny_skia::{Color, FillRule, LineCap, Paint, PathBuilder, Pixmap, Rect, Stroke, Transform};

const WIDTH: f32 = 480.0;
const HEIGHT: f32 = 320.0;

/// Sides of a block.
const LEFT: f32 = 110.0;
const RIGHT: f32 = 370.0;
const TOP: f32 = 60.0;
const BOTTOM: f32 = 260.0;

const PAPER: [u8; 3] = [0xff, 0xff, 0xff];
const PANEL: [u8; 3] = [0xf3, 0xf6, 0xf9];
const INK: [u8; 3] = [0x1b, 0x27, 0x33];
const FAINT: [u8; 3] = [0xc3, 0xce, 0xd8];
const ACCENT: [u8; 3] = [0x1f, 0x77, 0xb4];

/// The picture of a model, as PNG.
pub(super) fn png(model: &Model) -> Vec<u8> {
    drawn(|canvas| match model.kind() {
        Kind::Pilot(_) => pilot(canvas, model),
        Kind::Quadcopter => quadcopter(canvas),
    })
}

/// A block with an arrow for each input and output, as PNG: the picture of a model of which nothing else is
/// known.
pub(super) fn block(interface: &Interface) -> Vec<u8> {
    let count = |is: fn(&&Variable) -> bool| interface.variables.iter().filter(is).count();
    drawn(|canvas| {
        frame(canvas);
        let heights =
            |n: usize| (1..=n).map(move |i| TOP + (BOTTOM - TOP) * i as f32 / (n + 1) as f32);
        for y in heights(count(|v| v.role == Role::Input)) {
            canvas.arrow((30.0, y), (LEFT, y), INK);
        }
        for y in heights(count(|v| v.is_output())) {
            canvas.arrow((RIGHT, y), (450.0, y), INK);
        }
    })
}

fn drawn(draw: impl FnOnce(&mut Canvas)) -> Vec<u8> {
    let Some(mut pixmap) = Pixmap::new(WIDTH as u32, HEIGHT as u32) else {
        unreachable!("the size is not zero");
    };
    let [r, g, b] = PAPER;
    pixmap.fill(Color::from_rgba8(r, g, b, 255));
    let mut canvas = Canvas { pixmap };
    draw(&mut canvas);
    // Encoding into memory fails only for sizes that do not fit.
    canvas.pixmap.encode_png().unwrap_or_default()
}

struct Canvas {
    pixmap: Pixmap,
}

fn paint([r, g, b]: [u8; 3]) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

impl Canvas {
    fn line(&mut self, points: &[(f32, f32)], width: f32, color: [u8; 3]) {
        let mut path = PathBuilder::new();
        for (i, (x, y)) in points.iter().enumerate() {
            match i {
                0 => path.move_to(*x, *y),
                _ => path.line_to(*x, *y),
            }
        }
        let stroke = Stroke {
            width,
            line_cap: LineCap::Round,
            ..Stroke::default()
        };
        if let Some(path) = path.finish() {
            let (paint, here) = (paint(color), Transform::identity());
            self.pixmap.stroke_path(&path, &paint, &stroke, here, None);
        }
    }

    fn polygon(&mut self, points: &[(f32, f32)], color: [u8; 3]) {
        let mut path = PathBuilder::new();
        for (i, (x, y)) in points.iter().enumerate() {
            match i {
                0 => path.move_to(*x, *y),
                _ => path.line_to(*x, *y),
            }
        }
        path.close();
        if let Some(path) = path.finish() {
            let (paint, here) = (paint(color), Transform::identity());
            self.pixmap
                .fill_path(&path, &paint, FillRule::Winding, here, None);
        }
    }

    fn ellipse(&mut self, (x, y): (f32, f32), (rx, ry): (f32, f32), turn: f32, color: [u8; 3]) {
        let oval = Rect::from_xywh(x - rx, y - ry, 2.0 * rx, 2.0 * ry);
        if let Some(path) = oval.and_then(PathBuilder::from_oval) {
            let (paint, turned) = (paint(color), Transform::from_rotate_at(turn, x, y));
            self.pixmap
                .fill_path(&path, &paint, FillRule::Winding, turned, None);
        }
    }

    fn arrow(&mut self, from: (f32, f32), to: (f32, f32), color: [u8; 3]) {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let length = dx.hypot(dy);
        let (ux, uy) = (dx / length, dy / length);
        let (back, side) = (14.0, 6.0);
        let neck = (to.0 - back * ux, to.1 - back * uy);
        self.line(&[from, neck], 3.0, color);
        let corner = |s: f32| (neck.0 - s * side * uy, neck.1 + s * side * ux);
        self.polygon(&[to, corner(1.0), corner(-1.0)], color);
    }
}

fn frame(canvas: &mut Canvas) {
    let corners = [(LEFT, TOP), (RIGHT, TOP), (RIGHT, BOTTOM), (LEFT, BOTTOM)];
    canvas.polygon(&corners, PANEL);
    let [a, b, c, d] = corners;
    canvas.line(&[a, b, c, d, a], 3.0, INK);
}

/// A block with two inputs and an output, and in it the stick's answer to a sudden error.
fn pilot(canvas: &mut Canvas, model: &Model) {
    frame(canvas);
    canvas.arrow((30.0, 120.0), (LEFT, 120.0), INK);
    canvas.arrow((30.0, 200.0), (LEFT, 200.0), INK);
    canvas.arrow((RIGHT, 160.0), (450.0, 160.0), INK);
    let answer = answer(model);
    let most = answer.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    let scale = if most > 0.0 { 80.0 / most } else { 0.0 };
    let x = |i: usize| LEFT + 20.0 + (RIGHT - LEFT - 40.0) * i as f32 / (answer.len() - 1) as f32;
    canvas.line(&[(x(0), 160.0), (x(answer.len() - 1), 160.0)], 1.5, FAINT);
    let curve: Vec<_> = answer
        .iter()
        .enumerate()
        .map(|(i, v)| (x(i), 160.0 - (scale * v) as f32))
        .collect();
    canvas.line(&curve, 4.0, ACCENT);
}

/// The stick during ten seconds of an error of one metre. It ends early where the pilot overflows.
fn answer(model: &Model) -> Vec<f64> {
    let mut simulation = Simulation::new(model.clone());
    let stick = model.outputs().start;
    // The target is the first input; 1 m is within any range.
    let mut able = simulation.set(model.inputs().start, 1.0).is_ok();
    let mut stick_values = vec![simulation.get(stick); 2];
    for _ in 0..200 {
        able = able && simulation.step(0.05).is_ok();
        if able {
            stick_values.push(simulation.get(stick));
        }
    }
    stick_values
}

/// A quadcopter from the side, leaning into its way.
fn quadcopter(canvas: &mut Canvas) {
    let (lean, centre) = (0.22_f32, (230.0, 180.0));
    let (sin, cos) = lean.sin_cos();
    // From the vehicle's axes (right, up) to the picture's.
    let place = |x: f32, y: f32| (centre.0 + x * cos + y * sin, centre.1 + x * sin - y * cos);
    let degrees = lean.to_degrees();
    canvas.line(&[(40.0, 285.0), (440.0, 285.0)], 2.0, FAINT);
    canvas.line(&[place(-120.0, 0.0), place(120.0, 0.0)], 9.0, INK);
    for x in [-120.0, 120.0] {
        canvas.line(&[place(x, 0.0), place(x, 24.0)], 7.0, INK);
        canvas.ellipse(place(x, 28.0), (62.0, 6.0), degrees, ACCENT);
        canvas.arrow(place(x, 44.0), place(x, 104.0), INK);
    }
    canvas.ellipse(place(0.0, 2.0), (42.0, 18.0), degrees, INK);
    canvas.line(&[place(-26.0, -12.0), place(-40.0, -46.0)], 5.0, INK);
    canvas.line(&[place(26.0, -12.0), place(40.0, -46.0)], 5.0, INK);
    canvas.arrow((375.0, 245.0), (450.0, 245.0), ACCENT);
}
