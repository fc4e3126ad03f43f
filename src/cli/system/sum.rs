//! What a system is made of, as a number by which another one is told.

use crate::cli::Failure;
use crate::cosim::SystemDescription;
use crate::cosim::description::InstanceSource;
use sha2::{Digest, Sha256};

/// A sum of what instances are made of, and of how they are wired.
pub fn sum(description: &SystemDescription) -> Result<String, Failure> {
    let mut all = Sha256::new();
    for own in &description.instances {
        all.update(format!(
            "{} {:?} {:?} {}\n",
            own.name,
            own.order.as_ref().map(|own| own.value),
            own.interface,
            own.at_once
        ));
        match (&own.source.value, own.source.value.file()) {
            (InstanceSource::BuiltIn(name), _) => all.update(name),
            (_, Some(file)) => {
                // An unpacked FMU is told by its description.
                let file = if file.is_dir() {
                    file.join("modelDescription.xml")
                } else {
                    file.to_owned()
                };
                let bytes = crate::file::bytes(&file);
                all.update(bytes.map_err(|error| {
                    Failure::new(format!("cannot read {}: {error}", file.display()))
                })?);
                if crate::cli::recognise::is_model(&file) {
                    for (name, table) in &pilotage_language::read(&file)?.tables {
                        all.update(format!("{name}\n{}", table.text));
                    }
                }
            }
            (_, None) => {}
        }
    }
    for own in &description.connections {
        let by = &own.transformation;
        all.update(format!("{}={} {by:?}\n", own.from.value, own.to.value));
    }
    for own in &description.settings {
        all.update(format!("{}={}\n", own.name.value, own.value));
    }
    Ok(all
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect())
}
