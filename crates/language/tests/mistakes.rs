//! Every mistake in a model file has file, line, column and what to do.

use pilotage_language::parse;
use std::fmt::Write;

/// A model file of which one line is exchanged: the whole line, and what stands in its place.
const GOOD: &str = r#"[model]
name = "crossover"
[inputs]
target = { unit = "m" }
position = { unit = "m" }
[parameters]
gain = { start = 0.1, unit = "1/m", min = 0 }
lag = { start = 0.1, unit = "s", min = 0.02, max = 1 }
tau = { start = 0.3, unit = "s" }
[states]
arm = { unit = "1", der = "(wish - arm) / lag" }
[locals]
error = { unit = "m", value = "target - position" }
wish = { unit = "1", value = "gain * delay(error, tau, 2)" }
[outputs]
stick = { unit = "1", value = "arm", limit = [-1, 1] }
"#;

/// The beginning of the line that is exchanged, and what stands there instead.
const MISTAKES: &[(&str, &str)] = &[
    // TOML.
    ("name", "name = crossover"),
    ("gain", "gain = { start = 0,1, unit = \"1/m\" }"),
    ("[locals]", "[local]"),
    ("[locals]", "[states]"),
    ("[model]", "[modell]"),
    ("name", "title = \"crossover\""),
    ("name", "name = \"cross over\""),
    ("name", "name = 3"),
    ("[parameters]", "parameters = 3\n[other]"),
    // Declarations.
    ("gain", "gain = { unit = \"1/m\" }"),
    ("gain", "gain = { start = \"0.1\" }"),
    ("gain", "gain = { start = nan }"),
    ("gain", "gain = { start = 0.1, minimum = 0 }"),
    ("gain", "gain = { start = -1, min = 0 }"),
    ("gain", "gain = { start = 1, min = 2, max = 0 }"),
    ("gain", "gain = { start = 1, nominal = 0 }"),
    ("gain", "gain = { start = 1, unit = \"furlong\" }"),
    ("gain", "gain = { start = 1, unit = \"1/m/s\" }"),
    ("gain", "gain = { start = 1, tunable = \"yes\" }"),
    ("gain", "gain = true"),
    ("gain", "\"my gain\" = 1"),
    ("gain", "time = 1"),
    ("gain", "error = 1"),
    ("gain", "wish_delay_1 = 1"),
    ("arm", "arm = { unit = \"1\" }"),
    ("arm", "arm = { der = \"wish\", start = \"gain * error\" }"),
    ("arm", "arm = { der = \"wish\", start = \"1 / 0\" }"),
    ("arm", "arm = { der = \"wish\", start = 2, max = 1 }"),
    ("error", "error = { unit = \"m\" }"),
    ("stick", "stick = { unit = \"1\" }"),
    ("stick", "arm = { limit = [-1, 1] }"),
    ("stick", "stick = { value = \"arm\", limit = 1 }"),
    ("stick", "stick = { value = \"arm\", limit = [1, -1] }"),
    (
        "stick",
        "stick = { value = \"arm\", limit = [\"-arm\", 1] }",
    ),
    // Words of an expression.
    ("error", "error = \"\""),
    ("error", "error = \"target -\""),
    ("error", "error = \"target position\""),
    ("error", "error = \"(target - position\""),
    ("error", "error = \"target - position)\""),
    ("error", "error = \"target ** 2\""),
    ("error", "error = \"target = position\""),
    ("error", "error = \"if(target > 0 && position > 0, 1, 0)\""),
    ("error", "error = \"target % 2\""),
    ("error", "error = \"1.2.3\""),
    ("error", "error = \"2target\""),
    ("error", "error = \"target[1]\""),
    // Names.
    ("error", "error = \"traget - position\""),
    ("error", "error = \"Target - position\""),
    ("error", "error = \"whatever\""),
    ("error", "error = \"sinus(target)\""),
    ("error", "error = \"ln(target)\""),
    ("error", "error = \"sin\""),
    ("error", "error = \"gain(target)\""),
    ("error", "error = \"stick\""),
    ("error", "error = \"wish\""),
    // Arguments.
    ("error", "error = \"sin()\""),
    ("error", "error = \"sin(target, position)\""),
    ("error", "error = \"max(target)\""),
    ("error", "error = \"sat(target)\""),
    ("error", "error = \"if(target, 1, 0)\""),
    ("error", "error = \"target > position\""),
    ("error", "error = \"if(0 < target < 1, 1, 0)\""),
    ("error", "error = \"1 + (target > position)\""),
    ("error", "error = \"sin(target > 1)\""),
    ("error", "error = \"sin('file.csv')\""),
    ("error", "error = \"table(target, 1)\""),
    ("error", "error = \"table('nowhere.csv', target)\""),
    ("error", "error = \"table('../drag.csv', target)\""),
    ("error", "error = \"table('one_column.csv', target)\""),
    ("error", "error = \"table('falling.csv', target)\""),
    ("error", "error = \"table('word.csv', target)\""),
    ("error", "error = \"table('no_header.csv', target)\""),
    ("error", "error = \"table('short.csv', target)\""),
    ("error", "error = \"table('furlong.csv', target)\""),
    ("wish", "wish = \"gain * delay(error, tau, 6)\""),
    ("wish", "wish = \"gain * delay(error, tau, 0)\""),
    ("wish", "wish = \"gain * delay(error, tau, 1000000)\""),
    ("wish", "wish = \"gain * delay(error, tau, gain)\""),
    ("wish", "wish = \"gain * delay(error, arm, 2)\""),
    ("wish", "wish = \"gain * delay(error, time, 2)\""),
    // Units.
    (
        "error",
        "error = { unit = \"m\", value = \"target - tau\" }",
    ),
    (
        "error",
        "error = { unit = \"km\", value = \"target - position\" }",
    ),
    (
        "error",
        "error = { unit = \"s\", value = \"target - position\" }",
    ),
    ("arm", "arm = { unit = \"1\", der = \"wish - arm\" }"),
    (
        "arm",
        "arm = { unit = \"1\", der = \"arm / lag\", start = \"tau\" }",
    ),
    ("error", "error = { unit = \"1\", value = \"sin(target)\" }"),
    ("error", "error = { unit = \"1\", value = \"exp(target)\" }"),
    (
        "error",
        "error = { unit = \"m\", value = \"max(target, tau)\" }",
    ),
    (
        "error",
        "error = { unit = \"m\", value = \"if(target > tau, target, position)\" }",
    ),
    (
        "error",
        "error = { unit = \"m\", value = \"if(target > 0, target, tau)\" }",
    ),
    ("error", "error = { unit = \"m\", value = \"2 ^ target\" }"),
    (
        "error",
        "error = { unit = \"m\", value = \"target ^ gain\" }",
    ),
    (
        "wish",
        "wish = { unit = \"1\", value = \"delay(gain * error, gain, 2)\" }",
    ),
    (
        "error",
        "error = { unit = \"m\", value = \"table('drag.csv', tau)\" }",
    ),
    (
        "error",
        "error = { unit = \"m\", value = \"table('drag.csv', target / tau)\" }",
    ),
    (
        "stick",
        "stick = { unit = \"1\", value = \"arm\", limit = [\"-tau\", 1] }",
    ),
];

fn table(name: &str) -> std::io::Result<String> {
    let text = match name {
        "drag.csv" => "speed [m/s],drag [N]\n0,0\n10,5\n",
        "one_column.csv" => "speed\n0\n",
        "falling.csv" => "speed,drag\n0,1\n2,1\n1,1\n",
        "word.csv" => "speed,drag\n0,1\n1,lots\n",
        "no_header.csv" => "0,1\n1,2\n",
        "short.csv" => "speed,drag\n0,1\n",
        "furlong.csv" => "speed [furlong/s],drag\n0,1\n1,2\n",
        _ => return Err(std::io::ErrorKind::NotFound.into()),
    };
    Ok(text.to_owned())
}

/// The good file with the line that begins so exchanged.
fn with(line: &str, mistake: &str) -> String {
    let begins = |own: &str| {
        let rest = own.strip_prefix(line);
        rest.is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric()))
    };
    let lines = GOOD.lines().map(|own| match begins(own) {
        true => mistake,
        false => own,
    });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

#[test]
fn the_file_without_a_mistake_is_taken() {
    parse(GOOD, "model.toml", &table).expect("it is good");
}

#[test]
fn each_mistake_is_named_with_its_place() {
    let mut messages = String::new();
    for (line, mistake) in MISTAKES {
        let text = with(line, mistake);
        let error = parse(&text, "model.toml", &table);
        let error = error.expect_err(mistake).to_string();
        let _ = writeln!(messages, "{mistake}\n    {error}");
    }
    insta::assert_snapshot!(messages);
}

#[test]
fn other_mistakes_are_named_too() {
    let of = |text: &str| {
        let error = parse(text, "model.toml", &table);
        error.expect_err(text).to_string()
    };
    let head = "[model]\nname = \"m\"\n";
    insta::assert_snapshot!([
        of(""),
        of(head),
        of("[inputs]\nu = 1\n"),
        of(&format!("{head}[locals]\na = \"b\"\nb = \"c\"\nc = \"a + b\"\n")),
        of(&format!("{head}[locals]\na = \"a\"\n")),
        of(&format!("{head}[states]\nt = {{ unit = \"degC\", der = \"t\" }}\n")),
        of(&format!(
            "{head}[inputs]\na = {{ unit = \"degC\" }}\nb = {{ unit = \"degC\" }}\n[locals]\nc = \"a + b\"\n"
        )),
        of(&format!(
            "{head}[inputs]\na = {{ unit = \"degC\" }}\nb = {{ unit = \"K\" }}\n[locals]\nc = \"max(a, b)\"\n"
        )),
        of(&format!("{head}[locals]\na = \"\"\"\n1 +\n  x\"\"\"\n")),
        of(&format!("{head}[locals]\na = \"µ + x\"\n")),
    ]
    .join("\n"));
}

/// A factor in the wrong direction is not mended by a second one, and degrees of two kinds are converted by none.
#[test]
fn conversions_have_a_direction() {
    let of = |from: &str, to: &str, value: &str| {
        let text = format!(
            "[model]\nname = \"m\"\n[inputs]\nu = {{ unit = \"{from}\" }}\n[locals]\na = {{ unit = \"{to}\", value = \"{value}\" }}\n"
        );
        parse(&text, "model.toml", &table)
            .err()
            .map(|error| error.to_string())
    };
    for value in ["u / 3.6", "u * 0.2777778", "0.5 * u / 3.6"] {
        assert_eq!(of("km/h", "m/s", value), None, "{value}");
    }
    for value in ["u * 3.6", "u * 3.6 * 0.2777778"] {
        let message = of("km/h", "m/s", value).unwrap();
        let expected = "and 3.6 converts the other way; multiply by 0.277778 in its place";
        assert!(message.contains(expected), "{message}");
    }
    let message = of("degF", "degC", "u").unwrap();
    assert!(
        message.contains("differ in their zeros and their steps"),
        "{message}"
    );
}

/// What is too much ends with a message, and soon.
#[test]
fn depth_length_and_number_have_limits() {
    let of = |value: &str| {
        let text = format!("[model]\nname = \"m\"\n[inputs]\nu = 0\n[locals]\na = \"{value}\"\n");
        let error = parse(&text, "model.toml", &table);
        error.expect_err("too much").to_string()
    };
    let deep = format!("{}u{}", "(".repeat(5000), ")".repeat(5000));
    let long = vec!["sin(u)*1.1"; 100_000].join("+");
    let mut wide: String = (0..3000).map(|k| format!("p{k} = 1\n")).collect();
    wide = format!("[model]\nname = \"m\"\n[parameters]\n{wide}[locals]\na = 1\n");
    let wide = parse(&wide, "model.toml", &table)
        .expect_err("too many")
        .to_string();
    let many: String = (0..60_000).map(|k| format!("+sin(u+{k})*u")).collect();
    insta::assert_snapshot!([of(&deep), of(&long), of(&many), wide].join("\n"));
}

/// What a fit says is refused where it cannot be.
#[test]
fn an_uncertainty_that_cannot_be_is_refused() {
    const SURE: &str = r#"[uncertainty]
method = "cr3"
correlated_by = "ar"
parameters = ["gain", "lag", "tau"]
degrees_of_freedom = [3, 3, 3]
covariance = [
    [0.04, 0.01, 0],
    [0.01, 0.09, 0],
    [0, 0, 0],
]
[uncertainty.intervals]
gain = { sd = 0.2, low = -inf, high = 0.5 }
lag = { sd = 0.3, low = -1, high = 1.1 }
tau = { sd = 5, low = 0.3, high = inf }
"#;
    let whole = GOOD.to_owned() + SURE;
    parse(&whole, "model.toml", &table).expect("it can be");
    let of = |(right, wrong): (&str, &str)| {
        assert!(whole.contains(right), "{right}");
        let text = whole.replace(right, wrong);
        let error = parse(&text, "model.toml", &table).expect_err(wrong);
        error.to_string()
    };
    let all = [
        ("method = \"cr3\"", "method = 3"),
        ("method = \"cr3\"", "way = 3"),
        ("\"tau\"]", "\"tauu\"]"),
        ("\"tau\"]", "\"lag\"]"),
        ("[3, 3, 3]", "[3]"),
        ("[3, 3, 3]", "[3, nan, 3]"),
        ("[0.04, 0.01, 0]", "[0.04]"),
        ("0.09, 0]", "nan, 0]"),
        ("0.09, 0]", "-0.09, 0]"),
        ("0.01, 0]", "0.1, 0]"),
        ("0.01, 0]", "0.02, 0]"),
        ("sd = 0.2,", "sd = 0.25,"),
        ("sd = 0.2,", "sd = -0.2,"),
        ("low = -1", "low = 2"),
        ("tau = { sd = 5", "tau_ = { sd = 5"),
        ("tau = { sd = 5", "tau = { width = 5"),
    ]
    .map(of);
    insta::assert_snapshot!(all.join("\n"));
}
