//! Events within steps of co-simulation, compared with known solutions.

use pilotage_sdk::simulation::{StepError, StepFault};
use pilotage_sdk::{At, Equations, Scalar, Simulation, Table};

const G: f64 = 9.80665;

/// A ball that bounces; it never comes to rest.
#[derive(Debug, Clone, Default)]
struct Ball {
    restitution: f64,
}

impl Equations for Ball {
    fn table(&self) -> Table {
        Table::new("ball", "A ball that bounces")
            .input("floor", "m", "Height of the floor")
            .parameter("e", "1", self.restitution, "Restitution")
            .output_state("h", "m", 1.0, "Height")
            .output_state("v", "m/s", 0.0, "Velocity")
            .output_state("bounces", "1", 0.0, "How often it bounced")
            .indicator("gap", "m", "Distance to the floor")
    }

    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
        dx[0] = at.x[1];
        dx[1] = T::from(-G);
        dx[2] = T::from(0.0);
    }

    fn indicators<T: Scalar>(&self, at: At<T>, z: &mut [T]) {
        z[0] = at.x[0] - at.u[0];
    }

    fn event(&self, at: At<f64>, x: &mut [f64]) {
        if at.x[0] <= at.u[0] && at.x[1] < 0.0 {
            x[0] = at.u[0];
            x[1] = -at.p[0] * at.x[1];
            x[2] += 1.0;
        }
    }
}

fn ball(restitution: f64) -> Simulation<Ball> {
    Simulation::new(Ball { restitution })
}

fn get<E: Equations>(simulation: &Simulation<E>, name: &str) -> f64 {
    simulation.get(simulation.table().index(name).expect("it is declared"))
}

/// Height of a ball that loses no energy, at any time.
fn elastic(time: f64) -> f64 {
    let fall = (2.0 / G).sqrt();
    let since = (time + fall) % (2.0 * fall) - fall;
    1.0 - 0.5 * G * since * since
}

#[test]
fn bounces_are_located_whatever_the_step() {
    for h in [0.01, 0.05, 0.3, 1.0, 5.0] {
        let mut ball = ball(1.0);
        let steps = (5.0_f64 / h).round() as usize;
        for k in 1..=steps {
            ball.step(h).expect("it falls and bounces");
            let error = (get(&ball, "h") - elastic(k as f64 * h)).abs();
            assert!(error < 1e-9, "step {h}: error {error:e} after {k} steps");
        }
        assert_eq!(get(&ball, "bounces"), 6.0);
        assert!((get(&ball, "time") - steps as f64 * h).abs() < 1e-9);
    }
}

#[test]
fn a_step_can_stop_at_an_event_and_go_on_after_it() {
    let mut ball = ball(1.0);
    let fall = (2.0 / G).sqrt();
    let reached = ball.advance(1.0, true).expect("it falls");
    assert!(
        reached.event && (reached.time - fall).abs() < 1e-10,
        "{reached:?}"
    );
    // Not handled yet: the ball still falls.
    assert!(get(&ball, "h") <= 0.0 && get(&ball, "v") < 0.0);
    assert_eq!(ball.handle_event(), Ok(true));
    assert_eq!((get(&ball, "h"), get(&ball, "bounces")), (0.0, 1.0));
    assert_eq!(ball.handle_event(), Ok(false));
    let rest = 1.0 - reached.time;
    let reached = ball.advance(rest, true).expect("it rises");
    assert!(!reached.event && reached.time == rest);
    assert!((get(&ball, "h") - elastic(1.0)).abs() < 1e-9);
}

#[test]
fn a_jump_of_an_input_is_an_event_at_the_beginning_of_the_step() {
    let mut ball = ball(1.0);
    ball.step(0.1).expect("it falls");
    let floor = ball.table().index("floor").expect("an input");
    ball.set(floor, 0.97).expect("an input");
    let speed = get(&ball, "v");
    ball.step(1e-3).expect("it bounces at once");
    assert_eq!(get(&ball, "bounces"), 1.0);
    assert!((get(&ball, "v") - (-speed - G * 1e-3)).abs() < 1e-9);
}

#[test]
fn a_floor_that_rises_along_its_slope_is_met_where_it_is() {
    let mut ball = ball(1.0);
    let floor = ball.table().index("floor").expect("an input");
    ball.set_slope(floor, 1.0).expect("an input");
    let reached = ball.advance(1.0, true).expect("it falls");
    // 1 - g t²/2 = t
    let time = ((1.0 + 2.0 * G).sqrt() - 1.0) / G;
    assert!((reached.time - time).abs() < 1e-10, "{reached:?}");
    assert!((get(&ball, "floor") - time).abs() < 1e-10);
}

#[test]
fn a_crossing_there_and_back_within_a_step_is_seen() {
    // Half a second of free flight in one step, with the height just below the top of the parabola.
    struct Arc;
    impl Equations for Arc {
        fn table(&self) -> Table {
            Table::new("arc", "A ball thrown through a height")
                .output_state("h", "m", 0.0, "Height")
                .state("v", "m/s", G / 4.0, "Velocity")
                .output_state("passed", "1", 0.0, "How often the height was passed")
                .indicator("above", "m", "Distance to the height")
        }

        fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
            dx[0] = at.x[1];
            dx[1] = T::from(-G);
            dx[2] = T::from(0.0);
        }

        fn indicators<T: Scalar>(&self, at: At<T>, z: &mut [T]) {
            z[0] = at.x[0] - 0.25;
        }

        fn event(&self, at: At<f64>, x: &mut [f64]) {
            // Counts each side once: even below, odd above.
            let above = at.x[0] > 0.25;
            if above != (at.x[2] as i64 % 2 == 1) {
                x[2] += 1.0;
            }
        }
    }
    let mut arc = Simulation::new(Arc);
    arc.handle_event().expect("nothing yet");
    arc.step(0.5).expect("it flies");
    assert_eq!(get(&arc, "passed"), 2.0);
}

#[test]
fn what_was_reached_before_a_step_fails_is_kept() {
    /// `ẋ = x²` is infinite after 1 s.
    struct Explosion;
    impl Equations for Explosion {
        fn table(&self) -> Table {
            Table::new("explosion", "A solution that ends").output_state("x", "1", 1.0, "Size")
        }

        fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
            dx[0] = at.x[0] * at.x[0];
        }
    }
    let mut explosion = Simulation::new(Explosion);
    explosion.step(0.5).expect("it is 2 then");
    let error = explosion.step(2.0).expect_err("it is infinite at 1 s");
    assert!(matches!(error.fault, StepFault::Integration(_)), "{error}");
    assert!((error.reached - 0.5).abs() < 1e-3, "{error:?}");
    // State and time are consistent.
    let time = get(&explosion, "time");
    assert_eq!(time, 0.5 + error.reached);
    let x = get(&explosion, "x");
    assert!((1.0 / x - (1.0 - time)).abs() < 1e-7, "{x} at {time}");
}

#[test]
fn endless_events_are_given_up() {
    // Restitution below 1: infinitely many bounces before 1.9 s.
    let mut zeno = ball(0.6);
    let StepError { fault, reached } = zeno.step(5.0).expect_err("it never rests");
    assert!(matches!(fault, StepFault::TooManyEvents { .. }), "{fault}");
    let fall = (2.0 / G).sqrt();
    let end = fall * (1.0 + 2.0 * 0.6 / (1.0 - 0.6));
    assert!(
        reached <= end + 1e-6 && reached > 0.9 * end,
        "{reached} {end}"
    );

    /// An event that undoes itself.
    struct Flicker;
    impl Equations for Flicker {
        fn table(&self) -> Table {
            Table::new("flicker", "On and off").output_state("x", "1", 1.0, "On or off")
        }

        fn derivative<T: Scalar>(&self, _: At<T>, dx: &mut [T]) {
            dx[0] = T::from(0.0);
        }

        fn event(&self, at: At<f64>, x: &mut [f64]) {
            x[0] = -at.x[0];
        }
    }
    let fault = Simulation::new(Flicker).handle_event();
    assert!(matches!(fault, Err(StepFault::EndlessEvent { .. })));
}

/// FMI rule 27: the state is complete; steps are repeated bit by bit.
#[test]
fn a_snapshot_repeats_what_followed() {
    let mut ball = ball(0.9);
    ball.step(0.7).expect("it bounces");
    let snapshot = ball.snapshot().clone();
    let follow = |ball: &mut Simulation<Ball>| {
        for h in [0.1, 0.33, 0.02, 0.5] {
            ball.step(h).expect("it bounces");
        }
        ball.snapshot().clone()
    };
    let expected = follow(&mut ball);
    let mut other = ball.clone();
    for simulation in [&mut ball, &mut other] {
        simulation.restore(&snapshot);
        assert_eq!(follow(simulation), expected);
    }
}
