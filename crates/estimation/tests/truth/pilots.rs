//! Every built-in pilot, from the start values of its model file and data of the discretised model itself.

use crate::help::{Folder, sines, times, value};
use pilotage_estimation::Fit;

struct Case {
    pilot: &'static str,
    order: usize,
    vehicle: &'static str,
    /// What pilot and vehicle are told beside.
    truth: &'static [(&'static str, f64)],
    /// Parameters that stay at their truth, as others can stand for them.
    known: &'static [&'static str],
    amplitude: f64,
    seconds: f64,
    step: f64,
}

const PLAIN: Case = Case {
    pilot: "",
    order: 0,
    vehicle: "integrator",
    truth: &[],
    known: &[],
    amplitude: 2.0,
    seconds: 30.0,
    step: 0.05,
};

impl Case {
    fn problem(&self, parameters: &str, columns: &[&str], options: &str) -> String {
        let order = match self.order {
            0 => String::new(),
            order => format!("order = {order}"),
        };
        let position = match self.vehicle {
            "quadcopter" => "z",
            _ => "position",
        };
        let axes = if self.vehicle == "hover" { &["", "2"][..] } else { &[""] };
        let mut text = format!(
            "[system.pilot]\nmodel = \"{}\"\n{order}\n[system.vehicle]\nmodel = \"{}\"\n[connect]\n",
            self.pilot, self.vehicle
        );
        for axis in axes {
            text += &format!("\"pilot.stick{axis}\" = \"vehicle.stick{axis}\"\n");
            text += &format!("\"vehicle.{position}{axis}\" = \"pilot.position{axis}\"\n");
        }
        text += "[inputs]\n";
        for axis in axes {
            text += &format!("\"pilot.target{axis}\" = \"target{axis}\"\n");
        }
        for axis in axes {
            for (signal, column, sd) in [(format!("vehicle.{position}"), "position", 0.1), ("pilot.stick".into(), "stick", 0.01)] {
                if columns.contains(&column) {
                    text += &format!("[[measured]]\nsignal = \"{signal}{axis}\"\ncolumn = \"{column}{axis}\"\nsd = {sd}\n");
                }
            }
        }
        text + &format!("[parameters]\n{parameters}\n[[run]]\nfile = \"run.csv\"\n[fit]\nmesh = \"samples\"\n{options}\n")
    }

    fn run(&self, columns: &[&str]) -> (Fit, f64) {
        let folder = Folder::new();
        let time = times((self.seconds / self.step).round() as usize + 1, self.step);
        let target = sines(1, &time, self.amplitude);
        let target2 = sines(2, &time, self.amplitude);
        let zero = vec![0.0; time.len()];
        let names = ["position", "stick", "position2", "stick2"];
        let mut all: Vec<(&str, &[f64])> = vec![("time", &time), ("target", &target), ("target2", &target2)];
        all.extend(names.map(|name| (name, &zero[..])));
        folder.write("run.csv", &all);
        let fixed = |only: bool| {
            let line = |(name, value): &(&str, f64)| format!("\"pilot.{name}\" = {{ start = {value}, fixed = true }}\n");
            let kept = self.truth.iter().filter(|(name, _)| !only || self.known.contains(name));
            kept.map(line).collect::<String>()
        };
        let both = ["position", "stick"];
        let truth = folder.fit(&self.problem(&fixed(false), &both, "starts = 1\ntolerance = 1e-10"));
        assert!(truth.is_answer(), "{} {:?} {:?}", self.pilot, truth.status, truth.kkt);
        let run = &truth.runs[0];
        let most = |k: usize| run.predicted[k].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        println!("{} {} on {}: most {:?} target {:.2} poles {:?}", self.pilot, self.order, self.vehicle, (0..run.predicted.len()).map(most).collect::<Vec<_>>(),
            target.iter().fold(0.0f64, |m, v| m.max(v.abs())), truth.poles.iter().map(|p| format!("{:.2}{:+.2}i", p[0], p[1])).collect::<Vec<_>>().join(" "));
        all.truncate(3);
        all.extend(names.iter().zip(&run.predicted).map(|(name, own)| (*name, &own[..])));
        folder.write("run.csv", &all);
        let parameters = format!("\"pilot.*\" = {{}}\n{}", fixed(true));
        let fit = folder.fit(&self.problem(&parameters, columns, ""));
        let free = self.truth.iter().filter(|(name, _)| !self.known.contains(name));
        let error = free.map(|(name, truth)| {
            let found = value(&fit, &format!("pilot.{name}"), 0);
            println!("   {name} {found} true {truth}");
            (found / truth - 1.0).abs()
        });
        let error = error.fold(0.0, f64::max);
        println!("   {:?} error {error:.1e} f {:.3e} it {} {:.2}s", fit.status, fit.objective, fit.iterations, fit.seconds);
        for (status, f) in &fit.starts { println!("      {status:?} {f:.4e}"); }
        (fit, error)
    }
}

const CASES: &[Case] = &[
    Case { pilot: "tustin", truth: &[("gain", 0.5), ("lead", 0.45), ("delay", 0.13), ("lag", 0.06)], ..PLAIN },
    Case { pilot: "tustin", vehicle: "gain", truth: &[("gain", 1.5), ("lead", 0.45), ("delay", 0.13), ("lag", 0.06)], amplitude: 0.2, ..PLAIN },
    Case { pilot: "crossover", truth: &[("gain", 0.15), ("lag", 0.15), ("delay", 0.2)], ..PLAIN },
    Case { pilot: "lead_lag", vehicle: "double_integrator", truth: &[("gain", 0.045), ("lead", 1.5), ("lag", 0.15), ("delay", 0.13)], ..PLAIN },
    Case { pilot: "lead_lag", vehicle: "lag_integrator", truth: &[("gain", 0.09), ("lead", 1.5), ("lag", 0.15), ("delay", 0.13)], ..PLAIN },
    Case { pilot: "precision", vehicle: "double_integrator", truth: &[("gain", 0.045), ("lead", 1.6), ("lag", 0.15), ("delay", 0.06), ("muscle_lag", 0.06), ("omega_n", 13.0), ("zeta_n", 0.4)], known: &["muscle_lag"], ..PLAIN },
    Case { pilot: "extended_crossover", vehicle: "double_integrator", truth: &[("gain", 0.045), ("lead", 1.6), ("delay", 0.28), ("omega_nm", 7.0), ("zeta_nm", 0.5)], ..PLAIN },
    Case { pilot: "hess", vehicle: "double_integrator", truth: &[("gain", 0.42), ("delay", 0.13), ("feeling", 13.0), ("feeling_lag", 3.5), ("omega_n", 14.0), ("zeta_n", 0.4)], ..PLAIN },
    Case { pilot: "linear", order: 1, truth: &[("theta1", 9.0), ("theta2", 1.2), ("stick_limit", 1.0)], known: &["stick_limit"], ..PLAIN },
    Case { pilot: "linear", order: 2, truth: &[("theta1", 50.0), ("theta2", 8.0), ("theta3", 5.4), ("theta4", 1.1), ("stick_limit", 1.0)], known: &["stick_limit"], ..PLAIN },
    Case { pilot: "linear", order: 3, truth: &[("theta1", 320.0), ("theta2", 160.0), ("theta3", 25.0), ("theta4", 32.0), ("theta5", -5.0), ("theta6", 1.0), ("stick_limit", 1.0)], known: &["stick_limit"], ..PLAIN },
    Case { pilot: "linear", order: 4, truth: &[("theta1", 2000.0), ("theta2", 1250.0), ("theta3", 300.0), ("theta4", 34.0), ("theta5", 190.0), ("theta6", 50.0), ("theta7", -8.0), ("theta8", 1.0), ("stick_limit", 1.0)], known: &["stick_limit"], ..PLAIN },
    Case { pilot: "linear", order: 2, vehicle: "quadcopter", truth: &[("theta1", 50.0), ("theta2", 18.0), ("theta3", -3.0), ("theta4", -6.0), ("stick_limit", 1.0)], known: &["stick_limit"], ..PLAIN },
    Case { pilot: "dead_zone", truth: &[("gain", 0.15), ("threshold", 0.3), ("lag", 0.15), ("delay", 0.2)], ..PLAIN },
    Case { pilot: "rate_limit", truth: &[("gain", 0.15), ("rate", 1.5), ("lag", 0.06), ("delay", 0.2)], ..PLAIN },
    Case { pilot: "lead_lag", vehicle: "short_period", truth: &[("gain", 0.015), ("lead", 3.5), ("lag", 0.15), ("delay", 0.3)], ..PLAIN },
    Case { pilot: "crossover2", vehicle: "hover", truth: &[("gain", 0.07), ("gain2", 0.03), ("lead", 1.3), ("lag", 0.15), ("delay", 0.16)], ..PLAIN },
];

#[test]
fn explore() {
    let only = std::env::var("ONLY").unwrap_or_default();
    for (k, case) in CASES.iter().enumerate() {
        if !only.is_empty() && !only.split(',').any(|o| o.parse() == Ok(k)) { continue; }
        println!("#### {k}");
        for columns in [&["position", "stick"][..], &["position"]] {
            println!(" -- {columns:?}");
            let _ = std::panic::catch_unwind(|| { case.run(columns); });
        }
    }
}
