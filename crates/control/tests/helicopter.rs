//! The built-in helicopter: powers, autorotation and energy; landings and maps against figures that other code computed from
//! the same equations (CasADi with IPOPT, two independent programs).

use pilotage_control::hv::{
    Axis, Class, Column, Crossing, Grid, Helicopter, Landings, Pilot, Settings, column, joined, map,
};
use pilotage_estimation::system::part::Part;
use pilotage_expression::Tape;

fn helicopter() -> Helicopter {
    Helicopter::built_in(&[]).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found}, expected {expected}"
    );
}

/// Powers of hover and of level flight that were computed by other code from the same equations.
#[test]
fn powers_are_known() {
    let own = helicopter();
    let power = |h: f64, speed: f64| own.required_power(&own.trim(h, speed).unwrap()) / 1e3;
    // Given with their last digit cut off.
    assert_near(power(1000.0, 0.0), 167.75, 0.05);
    assert_near(power(0.9, 0.0), 152.65, 0.05);
    assert_near(power(0.0, 0.0), 141.85, 0.05);
    assert_near(power(1000.0, 20.0), 104.55, 0.05);
    // The least is a little faster, and hardly less.
    let least = (0..=40).map(|k| power(1000.0, 15.0 + 0.25 * f64::from(k)));
    assert_near(least.fold(f64::INFINITY, f64::min), 104.2, 0.1);
}

#[test]
fn thrust_in_hover_is_known() {
    let own = helicopter();
    assert_near(own.trim(1000.0, 0.0).unwrap().cz, 0.0630, 5e-5);
}

/// The model's derivatives and outputs at a state, by a tape of its own.
fn at(own: &Helicopter, states: [f64; 6], inputs: [f64; 2]) -> (Vec<f64>, Vec<f64>) {
    let file = own.part.file.as_ref().unwrap();
    let system = &file.model.system;
    let rows = [&system.derivatives[..], &system.outputs].concat();
    let tape = Tape::new(&system.graph, system.variables(), |_| false, &[&rows]);
    let point = [&[0.0][..], &states, &inputs, &file.parameters()].concat();
    let mut values = tape.evaluate(&point);
    let outputs = values.split_off(6);
    (values, outputs)
}

/// In steady autorotation at the nominal rotor speed neither speeds nor rotor speed nor inflow change: four equations for
/// `cz`, `alpha`, the inflow and the sink rate.
#[test]
fn autorotation_is_known() {
    let own = helicopter();
    for (speed, sink) in [(20.0, 7.62), (28.0, 8.23), (35.0, 10.15)] {
        let residual = |q: &[f64; 4]| {
            let (dx, _) = at(&own, [1000.0, speed, q[3], 37.07, q[2], 0.0], [q[0], q[1]]);
            [dx[1], dx[2], dx[3], dx[4]]
        };
        let mut q = [0.063, 0.05, 3.0, 8.0];
        for _ in 0..100 {
            let left = residual(&q);
            let columns: Vec<[f64; 4]> = (0..4)
                .map(|k| {
                    let mut other = q;
                    other[k] += 1e-6;
                    let moved = residual(&other);
                    [0, 1, 2, 3].map(|i| (moved[i] - left[i]) / 1e-6)
                })
                .collect();
            let step = eliminated(&columns, left);
            (0..4).for_each(|k| q[k] -= 0.5 * step[k]);
        }
        assert!(residual(&q).iter().all(|r| r.abs() < 1e-6), "{q:?}");
        assert_near(q[3], sink, 6e-3);
    }
}

/// Solves a system given by columns, by elimination.
fn eliminated(columns: &[[f64; 4]], right: [f64; 4]) -> [f64; 4] {
    let mut rows: Vec<[f64; 5]> = (0..4)
        .map(|i| {
            [
                columns[0][i],
                columns[1][i],
                columns[2][i],
                columns[3][i],
                right[i],
            ]
        })
        .collect();
    for k in 0..4 {
        let pivot = (k..4)
            .max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs()))
            .unwrap();
        rows.swap(k, pivot);
        for i in (0..4).filter(|i| *i != k) {
            let (factor, own) = (rows[i][k] / rows[k][k], rows[k]);
            (0..5).for_each(|j| rows[i][j] -= factor * own[j]);
        }
    }
    [0, 1, 2, 3].map(|k| rows[k][4] / rows[k][k])
}

/// d/dt (m g h + m V²/2 + I Ω²/2) = shaft - induced - profile - parasite - what the gears lose.
#[test]
fn energy_is_balanced() {
    let own = helicopter();
    let names = own.part.file.as_ref().unwrap().model.outputs.clone();
    let (mass, gravity, inertia, efficiency) = (1360.8, 9.80665, 438.0, 0.97);
    for (states, inputs) in [
        ([20.0, 0.0, 0.0, 37.07, 7.7, 0.0], [0.063, 0.0]),
        ([5.0, 12.0, 4.0, 33.0, 4.0, 5e4], [0.1, -0.3]),
        ([0.5, -3.0, 9.0, 25.0, 12.0, 0.0], [0.14, 0.4]),
        ([90.0, 30.0, -2.0, 38.0, 1.0, 1e5], [0.02, 0.1]),
    ] {
        let (dx, outputs) = at(&own, states, inputs);
        let power = |name: &str| outputs[names.iter().position(|own| own == name).unwrap()];
        let [_, u, w, omega, ..] = states;
        let rate =
            mass * gravity * dx[0] + mass * (u * dx[1] + w * dx[2]) + inertia * omega * dx[3];
        let lost = (1.0 - efficiency) * power("required_power");
        let parts = ["induced_power", "drag_power", "parasite_power"].map(power);
        let expected = power("shaft_power") - parts.iter().sum::<f64>() - lost;
        assert_near(rate / 1e5, expected / 1e5, 1e-9);
    }
}

fn landings(pilot: Option<f64>, settings: Settings) -> Landings {
    let pilot = pilot.map(|frequency| Pilot {
        name: "Butterworth".into(),
        axes: [Axis::butterworth(frequency), Axis::butterworth(frequency)],
    });
    Landings::new(helicopter(), pilot, settings).unwrap_or_else(|error| panic!("{error}"))
}

/// S within 0.5 % of the published figure, and its replay.
#[track_caller]
fn assert_landing(own: &Landings, [height, speed, delay]: [f64; 3], s: f64) {
    let found = own.from(height, speed, delay, None).expect("a landing");
    assert_near(found.s, s, 0.005 * s);
    assert_near(found.replayed, s, 0.02 + 0.005 * s);
    assert!(!found.is_certified);
}

#[test]
fn landings_without_delay_are_known() {
    let own = landings(None, Settings::default());
    assert_landing(&own, [20.0, 0.0, 0.0], 3.036);
    assert_landing(&own, [15.0, 9.0, 0.0], 1.213);
}

#[test]
fn a_landing_after_a_second_is_known() {
    let own = landings(None, Settings::default());
    assert_landing(&own, [20.0, 0.0, 1.0], 4.104);
}

#[test]
fn landings_through_a_pilot_are_known() {
    let own = landings(Some(4.0), Settings::default());
    assert_landing(&own, [20.0, 0.0, 0.3], 3.863);
    assert_landing(&own, [15.0, 9.0, 0.3], 1.915);
}

/// Twice as many intervals move S by less than 0.01.
#[test]
fn finer_meshes_change_little() {
    let coarse = landings(None, Settings::default());
    let fine = landings(
        None,
        Settings {
            intervals: 100,
            ..Settings::default()
        },
    );
    let of = |own: &Landings| own.from(15.0, 9.0, 0.0, None).unwrap().s;
    assert_near(of(&fine), of(&coarse), 0.01);
}

/// S falls with inertia and permitted speeds, rises with mass and delay; a fast pilot is none.
#[test]
fn s_is_monotone() {
    let s = |set: &[(&str, f64)], settings: Settings, delay: f64| {
        let set: Vec<(String, f64)> = set
            .iter()
            .map(|(name, value)| ((*name).to_owned(), *value))
            .collect();
        let own = Landings::new(Helicopter::built_in(&set).unwrap(), None, settings).unwrap();
        own.from(15.0, 9.0, delay, None).unwrap().s
    };
    let base = s(&[], Settings::default(), 0.0);
    assert!(s(&[("inertia", 911.0)], Settings::default(), 0.0) < base);
    assert!(s(&[("mass", 1500.0)], Settings::default(), 0.0) > base);
    assert!(s(&[], Settings::default(), 0.5) > base);
    let touch_down = |limits: [f64; 2]| Settings {
        touch_down: limits,
        ..Settings::default()
    };
    assert!(s(&[], touch_down([3.1, 15.0]), 0.0) < base);
    assert!(s(&[], touch_down([2.4, 7.5]), 0.0) > base);
    let slow = landings(Some(4.0), Settings::default())
        .from(15.0, 9.0, 0.0, None)
        .unwrap()
        .s;
    let fast = landings(Some(400.0), Settings::default())
        .from(15.0, 9.0, 0.0, None)
        .unwrap()
        .s;
    // Without the limits of rates, which a pilot stands for.
    assert!(
        fast < slow && fast < base && fast > 0.9 * base,
        "{slow} {fast} {base}"
    );
}

/// Heights at which S is 1: ±0.5 m of the low branch and ±1.5 m of the high one.
#[test]
fn boundaries_are_known() {
    let heights = [2.0, 4.0, 7.0, 12.0, 20.0, 30.0, 42.0, 60.0];
    let own = landings(None, Settings::default());
    for (delay, speed, low, high) in [(0.0, 9.0, 9.9, 22.4), (1.0, 12.0, 7.4, 23.1)] {
        let column = column(&own, &heights, speed, delay, &|| false).unwrap();
        let found: Vec<(f64, bool)> = column
            .crossings
            .iter()
            .map(|own| (own.height, own.opens))
            .collect();
        assert!(matches!(found[..], [(_, true), (_, false)]), "{found:?}");
        assert_near(found[0].0, low, 0.5);
        assert_near(found[1].0, high, 1.5);
        let classes: Vec<Class> = column.cells.iter().map(|own| own.class).collect();
        assert!(!classes.contains(&Class::Unknown), "{classes:?}");
    }
}

/// Both ends of the only unsafe range.
#[track_caller]
fn ends(column: &Column) -> [Crossing; 2] {
    let ranges = column.ranges();
    assert_eq!(ranges.len(), 1, "{ranges:?}");
    [ranges[0].low.unwrap(), ranges[0].high.unwrap()]
}

/// Where the ground comes before the pilot reacts, S is that of the fall: of the equations, integrated in small steps here.
#[test]
fn the_ground_may_come_during_the_delay() {
    let own = landings(None, Settings::default());
    for [height, speed] in [
        [0.3, 6.0],
        [1.36, 6.0],
        [0.64, 30.0],
        [3.0, 20.0],
        [2.0, 0.0],
    ] {
        let trim = own.helicopter().trim(height, speed).unwrap();
        let mut x: [f64; 6] = trim.states.clone().try_into().unwrap();
        const STEP: f64 = 1e-4;
        while x[0] > 0.0 {
            let rates = |x: [f64; 6]| at(own.helicopter(), x, [trim.cz, trim.alpha]).0;
            let first = rates(x);
            let middle = std::array::from_fn(|k| x[k] + 0.5 * STEP * first[k]);
            let second = rates(middle);
            x = std::array::from_fn(|k| x[k] + STEP * second[k]);
        }
        let expected = (x[2] / 2.4).max(x[1].abs() / 15.0);
        for delay in [2.5, 4.0] {
            let found = own.from(height, speed, delay, None).unwrap();
            assert_near(found.s, expected, 2e-3);
            assert_eq!(found.is_certified, expected <= 1.0);
        }
    }
}

/// Heights of hover at which S is 1 after 0.5 s, with other limits and coefficients: the same tolerances.
#[test]
fn boundaries_move_as_is_known() {
    let heights = [2.0, 3.0, 4.5, 30.0, 45.0, 52.0, 60.0, 75.0];
    let touch_down = |limits: [f64; 2]| Settings {
        touch_down: limits,
        ..Settings::default()
    };
    let flat = Settings {
        alpha: [15.0_f64.to_radians(), 1.5],
        ..Settings::default()
    };
    let cases = [
        (touch_down([2.4, 7.5]), 0.0087, 3.2, 52.6),
        // S is flat here: 53.7 is 1.6 m from what 50 intervals give.
        (touch_down([1.8, 15.0]), 0.0087, 2.5, 52.6),
        (touch_down([3.1, 15.0]), 0.0087, 4.1, 48.3),
        (flat, 0.0087, 3.2, 62.2),
        (Settings::default(), 0.012, 2.9, 56.6),
    ];
    for (settings, drag, low, high) in cases {
        let set = [("profile_drag".to_owned(), drag)];
        let own = Landings::new(Helicopter::built_in(&set).unwrap(), None, settings).unwrap();
        let column = column(&own, &heights, 0.0, 0.5, &|| false).unwrap();
        let [opens, closes] = ends(&column);
        assert_near(opens.height, low, 0.5);
        assert_near(closes.height, high, 1.5);
    }
}

/// The high-energy rotor lands from any hover.
#[test]
fn a_heavy_rotor_has_no_unsafe_hover() {
    let set = [("inertia".to_owned(), 911.0)];
    let own = Landings::new(
        Helicopter::built_in(&set).unwrap(),
        None,
        Settings::default(),
    )
    .unwrap();
    let heights: Vec<f64> = (0..9).map(|k| 5.0 * 1.4_f64.powi(k)).collect();
    let found = column(&own, &heights, 0.0, 0.0, &|| false).unwrap();
    assert!(found.crossings.is_empty(), "{:?}", found.crossings);
    let highest = found.cells.iter().map(|own| own.s).fold(0.0, f64::max);
    assert_near(highest, 1.0, 0.03);
}

/// A lag whose time constant is known to 10 %: its drawn pilots spread the boundary as lags of that many seconds do.
#[test]
fn a_band_is_what_other_pilots_have() {
    let lag = |seconds: f64| {
        format!(
            "[model]\nname = \"hand\"\n[inputs]\ntarget = {{}}\n[parameters]\nlag = {{ start = {seconds}, unit = \"s\", min = 0.01 }}\n\
             [states]\nstick = {{ der = \"(target - stick) / lag\" }}\n[outputs]\nstick = {{}}\n\
             [uncertainty]\nparameters = [\"lag\"]\ndegrees_of_freedom = [50]\ncovariance = [[9e-4]]\n"
        )
    };
    let part = |seconds: f64| {
        let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        Part::of_file(pilotage_language::parse(&lag(seconds), "hand.toml", &none).unwrap())
    };
    let pilot = |seconds: f64| Pilot::of(&part(seconds), "hand").unwrap();
    let of = |pilot: Pilot| Landings::new(helicopter(), Some(pilot), Settings::default()).unwrap();
    let drawn = Pilot::drawn(&part(0.3), "hand", 24).unwrap().unwrap();
    // Draws are those of a normal distribution, the same for any number.
    assert_eq!(
        drawn[..3],
        Pilot::drawn(&part(0.3), "hand", 3).unwrap().unwrap()
    );
    let lags: Vec<f64> = drawn.iter().map(|own| -1.0 / own.axes[0].a[0][0]).collect();
    let mean = lags.iter().sum::<f64>() / 24.0;
    let sd = (lags.iter().map(|own| (own - mean).powi(2)).sum::<f64>() / 23.0).sqrt();
    assert!(
        (mean - 0.3).abs() < 0.02 && (0.02..0.04).contains(&sd),
        "{mean} {sd}"
    );
    let heights = [2.0, 3.0, 4.5, 7.0, 12.0, 20.0, 30.0, 42.0, 60.0];
    let own = of(pilot(0.3)).with_draws(drawn).unwrap();
    let found = column(&own, &heights, 3.0, 0.3, &|| false).unwrap();
    let [low, high] = ends(&found);
    let (shortest, longest) = (
        lags.iter().copied().fold(1.0, f64::min),
        lags.iter().copied().fold(0.0, f64::max),
    );
    for (seconds, expected) in [
        (shortest, [low.range[1], high.range[0]]),
        (longest, [low.range[0], high.range[1]]),
    ] {
        let other = column(&of(pilot(seconds)), &heights, 3.0, 0.3, &|| false).unwrap();
        let [low, high] = ends(&other);
        // The range leaves out the outermost of 24, and interpolates between points.
        assert_near(expected[0], low.height, 0.15);
        assert_near(expected[1], high.height, 0.7);
    }
    let chances: Vec<f64> = found.cells.iter().map(|own| own.chance).collect();
    assert!(
        chances[0] == 1.0 && chances[4] == 0.0 && chances[8] == 1.0,
        "{chances:?}"
    );
}

/// Below the knee's height one delay, above it another.
#[test]
fn delays_may_differ_by_the_knee() {
    let own = landings(None, Settings::default());
    let grid = Grid {
        heights: vec![3.0, 6.0, 10.0, 16.0, 25.0, 50.0],
        speeds: vec![6.0, 10.5],
    };
    let of = |delay: f64| map(&own, &grid, delay, &[], &|_| {}, &|| false).unwrap();
    let (below, above) = (of(0.3), of(1.0));
    let [speed, height] = above.knee.unwrap();
    assert!(speed > 10.5 && below.knee.unwrap()[0] < speed);
    let both = joined(&below, &above, height);
    for k in 0..2 {
        let [low, high] = ends(&both.columns[k]);
        let expected = below.columns[k]
            .ranges()
            .first()
            .map_or(height, |own| own.heights[0]);
        assert!(low.height == expected || low.height == height, "{low:?}");
        assert_eq!(high.height, ends(&above.columns[k])[1].height);
        assert!(
            both.columns[k]
                .cells
                .iter()
                .map(|own| own.height)
                .eq(grid.heights.iter().copied())
        );
    }
}

/// A map is the same on one thread and on two, to the last bit.
#[test]
fn threads_change_nothing() {
    let own = landings(None, Settings::default());
    let grid = Grid {
        heights: vec![5.0, 15.0, 40.0],
        speeds: vec![6.0, 9.0, 12.0],
    };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let found = pool.install(|| map(&own, &grid, 0.0, &[], &|_| {}, &|| false));
        format!("{:?}", found.unwrap())
    };
    assert_eq!(on(1), on(2));
}
