//! What an FMU says about the compilation of its sources: `<SourceFiles>` of FMI 2.0 (2.0.5, section 2.2.4) and
//! `sources/buildDescription.xml` of FMI 3.0 (section 2.5.1.2.1), which FMI 2.0.4 adopted.

use crate::archive::name_fault;
use crate::description::{ModelDescription, is_within_limits};
use crate::platform;
use thiserror::Error;

/// Folder of the sources in the archive.
pub const FOLDER: &str = "sources/";

/// Name of the description.
pub const DESCRIPTION: &str = "sources/buildDescription.xml";

/// How one library of an FMU is made of its sources.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Build {
    /// The library's name without extension.
    pub model_identifier: String,
    /// Files that are compiled together, all below `sources`.
    pub sets: Vec<SourceSet>,
    /// Libraries of the system that are linked.
    pub libraries: Vec<String>,
}

/// Files that are compiled with the same settings.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SourceSet {
    /// Paths below `sources`.
    pub files: Vec<String>,
    /// Preprocessor definitions that are not optional: name and value.
    pub definitions: Vec<(String, Option<String>)>,
    /// Include directories below `sources`.
    pub includes: Vec<String>,
    /// Options for a compiler, which may be any of its options.
    pub options: Option<String>,
}

/// Why sources cannot be compiled.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SourceError {
    /// There are no files to compile.
    #[error(
        "it names no source files: neither <SourceFiles> in modelDescription.xml nor {DESCRIPTION}"
    )]
    None,
    /// The description is no XML.
    #[error("{DESCRIPTION} is no XML: {0}")]
    Xml(String),
    /// A path that leaves its folder.
    #[error("{DESCRIPTION} or <SourceFiles> names `{0}`, which is no path below sources/")]
    Path(String),
    /// A definition whose name is none in C.
    #[error("{DESCRIPTION} defines `{0}`, which is no name in C")]
    Definition(String),
    /// A library that is not the system's.
    #[error(
        "{DESCRIPTION} asks for the library `{0}`, which is in the FMU as a binary, and sources alone are compiled"
    )]
    Library(String),
    /// No configuration for a library on this machine.
    #[error("{DESCRIPTION} has no configuration of `{0}` for this machine")]
    Configuration(String),
}

/// How the libraries of an FMU are made: one for each modelIdentifier. `build` is the text of its buildDescription.xml.
///
/// # Errors
/// If no files are named, or what is named cannot be compiled safely.
pub fn builds(
    description: &ModelDescription,
    build: Option<&str>,
) -> Result<Vec<Build>, SourceError> {
    let kinds = [
        description
            .model_exchange
            .as_ref()
            .map(|own| (&own.model_identifier, &own.source_files[..])),
        description
            .co_simulation
            .as_ref()
            .map(|own| (&own.model_identifier, &own.source_files[..])),
        description
            .scheduled_execution
            .as_ref()
            .map(|own| (&own.model_identifier, &[][..])),
    ];
    let mut all: Vec<Build> = Vec::new();
    for (identifier, files) in kinds.into_iter().flatten() {
        let known = all
            .iter()
            .position(|own| own.model_identifier == *identifier);
        let place = known.unwrap_or_else(|| {
            all.push(Build {
                model_identifier: identifier.clone(),
                ..Build::default()
            });
            all.len() - 1
        });
        if build.is_none() {
            let sets = &mut all[place].sets;
            sets.resize(1, SourceSet::default());
            let new = files
                .iter()
                .filter(|own| !sets[0].files.contains(own))
                .cloned();
            let new: Vec<String> = new.collect();
            sets[0].files.extend(new);
        }
    }
    if let Some(text) = build {
        let wrong = |error: &dyn std::fmt::Display| SourceError::Xml(error.to_string());
        if !is_within_limits(text) {
            return Err(wrong(&"it is nested too deeply"));
        }
        let document = roxmltree::Document::parse(text).map_err(|error| wrong(&error))?;
        for own in &mut all {
            *own = configured(&document, &own.model_identifier)?;
        }
    }
    match all
        .iter()
        .any(|own| own.sets.iter().all(|set| set.files.is_empty()))
        || all.is_empty()
    {
        true => Err(SourceError::None),
        false => all.iter().try_for_each(check).map(|()| all),
    }
}

/// The first configuration for a library and this machine.
fn configured(document: &roxmltree::Document<'_>, identifier: &str) -> Result<Build, SourceError> {
    let here = platform::folders();
    let all = document
        .root_element()
        .children()
        .filter(|own| own.has_tag_name("BuildConfiguration"));
    let mut fitting = all.filter(|own| {
        let platform = own.attribute("platform");
        own.attribute("modelIdentifier") == Some(identifier)
            && platform.is_none_or(|own| here.iter().any(|here| here == own))
    });
    let Some(found) = fitting.next() else {
        return Err(SourceError::Configuration(identifier.to_owned()));
    };
    let is_true = |text: Option<&str>| matches!(text, Some("true" | "1"));
    let named = |node: &roxmltree::Node<'_, '_>, tag: &str| -> Vec<String> {
        let own = node.children().filter(|own| own.has_tag_name(tag));
        own.filter_map(|own| own.attribute("name").map(str::to_owned))
            .collect()
    };
    let sets = found
        .children()
        .filter(|own| own.has_tag_name("SourceFileSet"))
        .map(|set| {
            let definitions = set
                .children()
                .filter(|own| own.has_tag_name("PreprocessorDefinition"));
            let needed = definitions.filter(|own| !is_true(own.attribute("optional")));
            let pair = |own: roxmltree::Node<'_, '_>| {
                Some((
                    own.attribute("name")?.to_owned(),
                    own.attribute("value").map(str::to_owned),
                ))
            };
            SourceSet {
                files: named(&set, "SourceFile"),
                definitions: needed.filter_map(pair).collect(),
                includes: named(&set, "IncludeDirectory"),
                options: set.attribute("compilerOptions").map(str::to_owned),
            }
        });
    let sets = sets.collect();
    let mut libraries = Vec::new();
    for own in found.children().filter(|own| own.has_tag_name("Library")) {
        let name = own.attribute("name").unwrap_or_default().to_owned();
        match is_true(own.attribute("external")) {
            true => libraries.push(name),
            false => return Err(SourceError::Library(name)),
        }
    }
    Ok(Build {
        model_identifier: identifier.to_owned(),
        sets,
        libraries,
    })
}

/// Refuses what a compiler could take for something else than files below `sources`, names and libraries.
fn check(build: &Build) -> Result<(), SourceError> {
    let is_below = |path: &str| {
        let path = path.trim_end_matches('/');
        path == "." || (name_fault(path).is_none() && !path.starts_with('-'))
    };
    let is_word = |text: &str, also: &str| {
        let mut characters = text.chars();
        let may = |own: char| own.is_ascii_alphanumeric() || own == '_' || also.contains(own);
        characters
            .next()
            .is_some_and(|own| own.is_ascii_alphabetic() || own == '_')
            && characters.all(may)
    };
    for set in &build.sets {
        let mut paths = set.files.iter().chain(&set.includes);
        if let Some(path) = paths.find(|path| !is_below(path)) {
            return Err(SourceError::Path(path.clone()));
        }
        let mut names = set.definitions.iter().map(|(name, _)| name);
        if let Some(name) = names.find(|name| !is_word(name, "")) {
            return Err(SourceError::Definition(name.clone()));
        }
    }
    match build.libraries.iter().find(|name| !is_word(name, "+-.")) {
        Some(name) => Err(SourceError::Library(name.clone())),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{CoSimulation, ModelExchange};

    fn description() -> ModelDescription {
        let own = || vec!["a.c".to_owned(), "b/c.c".to_owned()];
        let model_identifier = "m".to_owned();
        ModelDescription {
            co_simulation: Some(CoSimulation {
                model_identifier: model_identifier.clone(),
                source_files: own(),
                ..CoSimulation::default()
            }),
            model_exchange: Some(ModelExchange {
                model_identifier,
                source_files: own(),
                ..ModelExchange::default()
            }),
            ..ModelDescription::default()
        }
    }

    fn of(inner: &str) -> Result<Vec<Build>, SourceError> {
        let text = format!(
            "<fmiBuildDescription fmiVersion=\"3.0\"><BuildConfiguration modelIdentifier=\"m\" platform=\"amiga\"/>\
             <BuildConfiguration modelIdentifier=\"m\">{inner}</BuildConfiguration></fmiBuildDescription>"
        );
        builds(&description(), Some(&text))
    }

    #[test]
    fn both_places_are_read() {
        let found = builds(&description(), None).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].sets[0].files, ["a.c", "b/c.c"]);
        let set = "<SourceFileSet compilerOptions=\"-O3\"><SourceFile name=\"a.c\"/>\
                   <PreprocessorDefinition name=\"N\" value=\"3\"/><PreprocessorDefinition name=\"O\" optional=\"true\"/>\
                   <IncludeDirectory name=\"inc\"/></SourceFileSet><Library name=\"m\" external=\"true\"/>";
        let found = of(set).unwrap();
        let expected = SourceSet {
            files: vec!["a.c".into()],
            definitions: vec![("N".into(), Some("3".into()))],
            includes: vec!["inc".into()],
            options: Some("-O3".into()),
        };
        assert_eq!(
            found,
            [Build {
                model_identifier: "m".into(),
                sets: vec![expected],
                libraries: vec!["m".into()]
            }]
        );
    }

    #[test]
    fn what_is_no_path_no_name_or_no_library_of_the_system_is_refused() {
        let set = |inner: &str| {
            of(&format!(
                "<SourceFileSet><SourceFile name=\"a.c\"/>{inner}</SourceFileSet>"
            ))
        };
        assert!(set("").is_ok());
        assert_eq!(of(""), Err(SourceError::None));
        let refused = |inner: &str| set(inner).unwrap_err();
        for path in ["../a.c", "/etc/a.c", "-fplugin=a.so"] {
            assert_eq!(
                refused(&format!("<SourceFile name=\"{path}\"/>")),
                SourceError::Path(path.into())
            );
            assert_eq!(
                refused(&format!("<IncludeDirectory name=\"{path}\"/>")),
                SourceError::Path(path.into())
            );
        }
        let name = "A -fplugin=x";
        assert_eq!(
            refused(&format!("<PreprocessorDefinition name=\"{name}\"/>")),
            SourceError::Definition(name.into())
        );
        for library in [
            "<Library name=\"own\"/>",
            "<Library name=\"../x\" external=\"true\"/>",
        ] {
            assert!(matches!(
                of(&format!(
                    "<SourceFileSet><SourceFile name=\"a.c\"/></SourceFileSet>{library}"
                )),
                Err(SourceError::Library(_))
            ));
        }
        assert!(matches!(
            builds(&description(), Some("<a")),
            Err(SourceError::Xml(_))
        ));
    }
}
