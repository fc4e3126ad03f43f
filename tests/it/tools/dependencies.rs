//! What deny.toml allows, on the dependencies of this platform: without cargo-deny, whose build takes minutes, and without
//! a network.

use spdx::{Expression, ParseMode};
use std::path::Path;
use std::process::Command;

/// The texts at a key of a table.
fn texts(table: &toml::Table, key: &str) -> Vec<String> {
    let texts = table[key].as_array().expect("a list").iter();
    texts
        .map(|text| text.as_str().expect("text").to_owned())
        .collect()
}

#[test]
fn dependencies_are_those_that_are_allowed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let allowed = std::fs::read_to_string(root.join("deny.toml")).unwrap();
    let allowed: toml::Table = allowed.parse().unwrap();
    let table = |name: &str| allowed[name].as_table().expect("a table");
    let (licences, sources) = (
        texts(table("licenses"), "allow"),
        texts(table("sources"), "allow-registry"),
    );
    let platform = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--offline",
            "--locked",
            "--format-version=1",
            "--filter-platform",
            &platform,
        ])
        .current_dir(root)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let mut wrong = Vec::new();
    for package in packages {
        let (name, licence) = (
            &package["name"],
            package["license"].as_str().unwrap_or_default(),
        );
        let expression = Expression::parse_mode(licence, ParseMode::LAX);
        let is_allowed = |required: &spdx::LicenseReq| licences.contains(&required.to_string());
        if !expression.is_ok_and(|expression| expression.evaluate(is_allowed)) {
            wrong.push(format!("{name}: licence `{licence}`"));
        }
        // Our own have none.
        if let Some(source) = package["source"].as_str()
            && !sources
                .iter()
                .any(|allowed| source == format!("registry+{allowed}"))
        {
            wrong.push(format!("{name}: from {source}"));
        }
    }
    for accepted in table("advisories")["ignore"].as_array().unwrap() {
        let name = accepted["crate"].as_str().unwrap();
        if !packages.iter().any(|package| package["name"] == name) {
            wrong.push(format!(
                "{name}: its advisory is accepted, and it is no dependency any more"
            ));
        }
    }
    assert!(
        wrong.is_empty(),
        "deny.toml does not allow:\n{}",
        wrong.join("\n")
    );
    assert!(packages.len() > 100, "{}", packages.len());
}
