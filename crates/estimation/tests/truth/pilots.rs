//! Every built-in pilot, from the start values of its model file and data of the discretised model itself: the solution
//! on the same mesh with all parameters at the truth, 30 to 60 % away from the start.

use crate::help::{Folder, at_rows, sines, times, value};

struct Case {
    pilot: &'static str,
    order: usize,
    vehicle: &'static str,
    truth: &'static [(&'static str, f64)],
    /// Parameters that stay at their truth, as others can stand for them.
    known: &'static [&'static str],
    amplitude: f64,
}

const PLAIN: Case = Case {
    pilot: "",
    order: 0,
    vehicle: "integrator",
    truth: &[],
    known: &[],
    amplitude: 2.0,
};

/// What is measured, and with which noise level.
const COLUMNS: [(&str, f64); 2] = [("position", 0.1), ("stick", 0.01)];

impl Case {
    fn problem(&self, parameters: &str, measured: usize, options: &str) -> String {
        let order = match self.order {
            0 => String::new(),
            order => format!("order = {order}"),
        };
        let position = match self.vehicle {
            "quadcopter" => "z",
            _ => "position",
        };
        let (mut wires, mut inputs, mut columns) = (String::new(), String::new(), String::new());
        for axis in self.axes() {
            wires += &format!("\"pilot.stick{axis}\" = \"vehicle.stick{axis}\"\n");
            wires += &format!("\"vehicle.{position}{axis}\" = \"pilot.position{axis}\"\n");
            inputs += &format!("\"pilot.target{axis}\" = \"target{axis}\"\n");
            for (column, sd) in &COLUMNS[..measured] {
                columns += &format!(
                    "[[measured]]\nsignal = \"pilot.{column}{axis}\"\ncolumn = \"{column}{axis}\"\nsd = {sd}\n"
                );
            }
        }
        format!(
            "[system.pilot]\nmodel = \"{}\"\n{order}\n[system.vehicle]\nmodel = \"{}\"\n[connect]\n{wires}[inputs]\n\
             {inputs}{columns}[parameters]\n{parameters}[[run]]\nfile = \"run.csv\"\n[fit]\nmesh = \"samples\"\nscheme = \"hermite-simpson\"\n{options}",
            self.pilot, self.vehicle
        )
    }

    fn axes(&self) -> &'static [&'static str] {
        match self.vehicle {
            "hover" => &["", "2"],
            _ => &[""],
        }
    }

    fn fixed(&self, is_meant: impl Fn(&str) -> bool) -> String {
        let meant = self.truth.iter().filter(|(name, _)| is_meant(name));
        let line = |(name, value): &(&str, f64)| {
            format!("\"pilot.{name}\" = {{ start = {value}, fixed = true }}\n")
        };
        meant.map(line).collect()
    }

    /// Largest relative error of a parameter, where so many of the columns are measured.
    fn error(&self, measured: usize, starts: usize) -> f64 {
        let folder = Folder::new();
        let time = times(601, 0.05);
        let targets = [
            sines(1, &time, self.amplitude),
            sines(2, &time, self.amplitude),
        ];
        let zero = vec![0.0; time.len()];
        let mut columns: Vec<(&str, &[f64])> = vec![
            ("time", &time),
            ("target", &targets[0]),
            ("target2", &targets[1]),
        ];
        let names = ["position", "stick", "position2", "stick2"];
        columns.extend(names.map(|name| (name, &zero[..])));
        folder.write("run.csv", &columns);
        let all = self.problem(&self.fixed(|_| true), 2, "starts = 1\ntolerance = 1e-10\n");
        let truth = folder.fit(&all);
        assert!(truth.is_answer(), "{}: {:?}", self.pilot, truth.status);
        let predicted = at_rows(&truth, 0);
        columns.truncate(3);
        columns.extend(
            names
                .iter()
                .zip(&predicted)
                .map(|(name, own)| (*name, &own[..])),
        );
        folder.write("run.csv", &columns);
        let known = self.fixed(|name| self.known.contains(&name));
        let fit = folder.fit(&self.problem(
            &format!("\"pilot.*\" = {{}}\n{known}"),
            measured,
            &format!("starts = {starts}\n"),
        ));
        assert!(fit.is_answer(), "{}: {:?}", self.pilot, fit.status);
        let free = self
            .truth
            .iter()
            .filter(|(name, _)| !self.known.contains(name));
        let error = free
            .map(|(name, truth)| (value(&fit, &format!("pilot.{name}"), 0) / truth - 1.0).abs());
        error.fold(0.0, f64::max)
    }
}

/// Structural: of `precision`, `lag` and `muscle_lag` can be exchanged, so one is known; `stick_limit` only bounds. The
/// numerators of `linear` start at zero beyond the first, and on the quadcopter all at the wrong sign.
const CASES: &[Case] = &[
    Case {
        pilot: "tustin",
        truth: &[
            ("gain", 0.5),
            ("lead", 0.45),
            ("delay", 0.13),
            ("lag", 0.06),
        ],
        ..PLAIN
    },
    Case {
        pilot: "tustin",
        vehicle: "gain",
        truth: &[
            ("gain", 1.5),
            ("lead", 0.45),
            ("delay", 0.13),
            ("lag", 0.06),
        ],
        amplitude: 0.2,
        ..PLAIN
    },
    Case {
        pilot: "crossover",
        truth: &[("gain", 0.15), ("lag", 0.15), ("delay", 0.2)],
        ..PLAIN
    },
    Case {
        pilot: "lead_lag",
        vehicle: "double_integrator",
        truth: &[
            ("gain", 0.045),
            ("lead", 1.5),
            ("lag", 0.15),
            ("delay", 0.13),
        ],
        ..PLAIN
    },
    Case {
        pilot: "lead_lag",
        vehicle: "lag_integrator",
        truth: &[
            ("gain", 0.09),
            ("lead", 0.9),
            ("lag", 0.15),
            ("delay", 0.13),
        ],
        ..PLAIN
    },
    Case {
        pilot: "precision",
        vehicle: "double_integrator",
        truth: &[
            ("gain", 0.045),
            ("lead", 1.6),
            ("lag", 0.15),
            ("delay", 0.06),
            ("muscle_lag", 0.06),
            ("omega_n", 13.0),
            ("zeta_n", 0.4),
        ],
        known: &["muscle_lag"],
        ..PLAIN
    },
    Case {
        pilot: "extended_crossover",
        vehicle: "double_integrator",
        truth: &[
            ("gain", 0.045),
            ("lead", 1.6),
            ("delay", 0.28),
            ("omega_nm", 7.0),
            ("zeta_nm", 0.5),
        ],
        ..PLAIN
    },
    Case {
        pilot: "hess",
        vehicle: "double_integrator",
        truth: &[
            ("gain", 0.42),
            ("delay", 0.13),
            ("feeling", 13.0),
            ("feeling_lag", 3.5),
            ("omega_n", 14.0),
            ("zeta_n", 0.4),
        ],
        ..PLAIN
    },
    Case {
        pilot: "linear",
        order: 1,
        truth: &[("theta1", 9.0), ("theta2", 1.2), ("stick_limit", 1.0)],
        known: &["stick_limit"],
        ..PLAIN
    },
    Case {
        pilot: "linear",
        order: 2,
        truth: &[
            ("theta1", 50.0),
            ("theta2", 8.0),
            ("theta3", 5.4),
            ("theta4", 1.1),
            ("stick_limit", 1.0),
        ],
        known: &["stick_limit"],
        ..PLAIN
    },
    Case {
        pilot: "linear",
        order: 3,
        truth: &[
            ("theta1", 320.0),
            ("theta2", 160.0),
            ("theta3", 25.0),
            ("theta4", 32.0),
            ("theta5", -5.0),
            ("theta6", 1.0),
            ("stick_limit", 1.0),
        ],
        known: &["stick_limit"],
        ..PLAIN
    },
    Case {
        pilot: "linear",
        order: 4,
        truth: &[
            ("theta1", 2000.0),
            ("theta2", 1250.0),
            ("theta3", 300.0),
            ("theta4", 34.0),
            ("theta5", 190.0),
            ("theta6", 50.0),
            ("theta7", -8.0),
            ("theta8", 1.0),
            ("stick_limit", 1.0),
        ],
        known: &["stick_limit"],
        ..PLAIN
    },
    Case {
        pilot: "linear",
        order: 2,
        vehicle: "quadcopter",
        truth: &[
            ("theta1", 50.0),
            ("theta2", 18.0),
            ("theta3", -3.0),
            ("theta4", -6.0),
            ("stick_limit", 1.0),
        ],
        known: &["stick_limit"],
        ..PLAIN
    },
    Case {
        pilot: "dead_zone",
        truth: &[
            ("gain", 0.15),
            ("threshold", 0.3),
            ("lag", 0.15),
            ("delay", 0.2),
        ],
        ..PLAIN
    },
    Case {
        pilot: "rate_limit",
        truth: &[("gain", 0.15), ("rate", 1.5), ("lag", 0.06), ("delay", 0.2)],
        ..PLAIN
    },
    Case {
        pilot: "lead_lag",
        vehicle: "short_period",
        truth: &[
            ("gain", 0.015),
            ("lead", 3.5),
            ("lag", 0.15),
            ("delay", 0.3),
        ],
        ..PLAIN
    },
    Case {
        pilot: "crossover2",
        vehicle: "hover",
        truth: &[
            ("gain", 0.07),
            ("gain2", 0.03),
            ("lead", 1.3),
            ("lag", 0.15),
            ("delay", 0.16),
        ],
        ..PLAIN
    },
];

#[test]
fn pilots_come_back_from_position_and_stick() {
    for case in CASES {
        let error = case.error(2, 8);
        assert!(
            error < 1e-6,
            "{} {} on {}: {error}",
            case.pilot,
            case.order,
            case.vehicle
        );
    }
}

/// From the given start alone; but not from one of the wrong sign.
#[test]
fn pilots_come_back_from_the_position_alone() {
    for case in CASES.iter().filter(|case| case.vehicle != "quadcopter") {
        let error = case.error(1, 1);
        assert!(
            error < 1e-6,
            "{} {} on {}: {error}",
            case.pilot,
            case.order,
            case.vehicle
        );
    }
}
