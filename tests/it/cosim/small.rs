//! Values far below 1 without nominal values: as accurate as large ones.

use crate::command::Folder;
use pilotage::series::Series;

/// A loop of two models whose solution is S exp(-1.4 t)/1.25.
fn write_loop(folder: &Folder, size: f64) {
    let model = |name: &str, rest: String| {
        let text = format!("[model]\nname = \"{name}\"\n[inputs]\nu = 0\n{rest}");
        folder.write(&format!("{name}.toml"), text);
    };
    let state = format!("[states]\nx = {{ start = {size:e}, der = \"k*(u - x)\" }}\n");
    let parameters = "[parameters]\nk = { start = 1, unit = \"1/s\" }\n";
    model(
        "c",
        format!("{parameters}{state}[outputs]\ny = \"x + 0.5*u\"\n"),
    );
    model("d", "[outputs]\ny = \"-0.5*u\"\n".to_owned());
}

fn arguments(options: &[&'static str]) -> Vec<&'static str> {
    let fixed = "cosim c.toml d.toml --connect c.y=d.u --connect d.y=c.u --step 0.05 --stop-time 2 --force -o o.csv";
    fixed.split(' ').chain(options.iter().copied()).collect()
}

#[test]
fn errors_are_relative_to_the_values() {
    let folder = Folder::new();
    for (options, allowed) in [
        (&["--algorithm", "strong"][..], 1e-7),
        (&["--algorithm", "strong", "--tolerance", "1e-6"], 1e-9),
        (&["--tolerance", "1e-3"], 1e-3),
    ] {
        for size in [1.0, 1e-4, 1e-7, 1e-10] {
            write_loop(&folder, size);
            let ended = folder.pilotage(&arguments(options));
            assert_eq!(ended.code, 0, "{ended:?}");
            let found = Series::read_table(&folder.path("o.csv")).unwrap();
            let y = &found
                .columns
                .iter()
                .find(|own| own.name == "c.y")
                .unwrap()
                .values;
            for (t, y) in found.time.iter().zip(y) {
                let error = y / size - f64::exp(-1.4 * t) / 1.25;
                assert!(
                    error.abs() < allowed,
                    "{options:?}, {size:e}: {error:e} at {t} s"
                );
            }
        }
    }
}

/// An output that is zero but for rounding costs some steps to tell, and no more.
#[test]
fn noise_is_no_signal() {
    let folder = Folder::new();
    let noisy = "[model]\nname = \"c\"\n[inputs]\nu = 0\n[parameters]\nw = { start = 1, unit = \"rad/s\" }\n\
                 k = { start = 10, unit = \"1/s\" }\n[states]\nx = { start = 0.3, der = \"k*(0.3 - x + 1e-2*u)\" }\n[outputs]\n\
                 y = \"1e4*x*cos(w*time)*cos(w*time) + 1e4*x*sin(w*time)*sin(w*time) - 3e3\"\n";
    folder.write("c.toml", noisy);
    let other = "[model]\nname = \"d\"\n[inputs]\nu = 0\n[outputs]\ny = \"-1e-6*u\"\n";
    folder.write("d.toml", other);
    for options in [
        &["--tolerance", "1e-6"][..],
        &["--algorithm", "strong"],
        &["--algorithm", "strong", "--tolerance", "1e-6"],
    ] {
        let ended = folder.pilotage(&arguments(options));
        assert_eq!(ended.code, 0, "{ended:?}");
        assert!(!ended.stdout.contains("warning"), "{ended:?}");
        let steps = ended.stdout.lines().find_map(|line| {
            let (count, _) = line.split_once(" communication steps taken")?;
            count.parse::<u32>().ok()
        });
        assert!(steps.unwrap() < 4000, "{options:?}: {ended:?}");
    }
}

/// A jump between two points of the clock and a loop that is not linear: errors follow the values there, too.
#[test]
fn jumps_of_small_values_are_crossed() {
    let folder = Folder::new();
    let last = |options: &[&'static str], size: f64| {
        let text = format!(
            "[model]\nname = \"c\"\n[inputs]\nu = 0\n[parameters]\nk = {{ start = 3, unit = \"1/s\" }}\n\
             t1 = {{ start = 0.777, unit = \"s\" }}\n[states]\nx = {{ start = {size:e}, der = \"k*(u - x)\" }}\n[outputs]\n\
             y = \"x + if(time > t1, {size:e}, 0)\"\n"
        );
        folder.write("c.toml", text);
        let text = format!(
            "[model]\nname = \"d\"\n[inputs]\nu = 0\n[parameters]\nk = {{ start = 7, unit = \"1/s\" }}\n[states]\n\
             z = {{ start = 0, der = \"k*(u - z)\" }}\n[outputs]\ny = \"-z*z*z/{:e}\"\n",
            size * size
        );
        folder.write("d.toml", text);
        let ended = folder.pilotage(&arguments(options));
        assert_eq!(ended.code, 0, "{ended:?}");
        let found = Series::read_table(&folder.path("o.csv")).unwrap();
        let y = found.columns.iter().find(|own| own.name == "c.y");
        y.unwrap().values.last().unwrap() / size
    };
    for (options, allowed) in [
        (&["--algorithm", "strong", "--tolerance", "1e-6"][..], 1e-5),
        (&["--tolerance", "1e-3"], 1e-3),
    ] {
        let large = last(options, 1.0);
        for size in [1e-3, 1e-6, 1e-9] {
            let small = last(options, size);
            assert!(
                (small - large).abs() < allowed,
                "{options:?} {size:e}: {small} {large}"
            );
        }
    }
}

/// Lines through the last points do not settle in a loop of this gain, however short the steps: the run ends, and says so.
#[test]
fn steps_that_make_no_error_smaller_end_the_run() {
    let folder = Folder::new();
    write_loop(&folder, 1.0);
    let gains = [("c", "x - 0.65*u", "x + 0.5*u"), ("d", "0.65*u", "-0.5*u")];
    for (name, gain, before) in gains {
        let file = format!("{name}.toml");
        folder.write(&file, folder.read(&file).replace(before, gain));
    }
    let ended = folder.pilotage(&arguments(&["--extrapolation", "1", "--tolerance", "1e-5"]));
    assert_eq!(ended.code, 1, "{ended:?}");
    assert!(ended.stderr.contains("--algorithm strong"), "{ended:?}");
}

/// Loops of outputs at the start: relative to their values, and refused if they have no solution.
#[test]
fn initial_loops_of_small_values_are_solved() {
    let folder = Folder::new();
    let looped = |formula: &str| {
        let model = |name, y| {
            format!("[model]\nname = \"{name}\"\n[inputs]\nu = 0\n[outputs]\ny = \"{y}\"\n")
        };
        folder.write("c.toml", model("c", formula));
        folder.write("d.toml", model("d", "u"));
        let ended = folder.pilotage(&arguments(&[]));
        let found = Series::read_table(&folder.path("o.csv"));
        let first = found.map(|found| found.columns[0].values[0]);
        (ended.code, first.unwrap_or(f64::NAN))
    };
    for (formula, exact) in [
        ("0.5*u + 1e-12", 2e-12),
        ("0.5*u + 1e-13", 2e-13),
        ("-5*u + 1e-300", 1e-300 / 6.0),
        ("0.5*u + 1", 2.0),
    ] {
        let (code, first) = looped(formula);
        assert_eq!(code, 0, "{formula}");
        assert!((first / exact - 1.0).abs() < 1e-9, "{formula}: {first:e}");
    }
    for formula in ["u + 1e-9", "0.999999999*u + 1e-9"] {
        assert_ne!(looped(formula).0, 0, "{formula}");
    }
}
