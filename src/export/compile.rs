//! Compiles the sources of an FMU, anybody's, into a library for this machine.
//!
//! Nothing of the FMU runs: its sources are read by a compiler, with the definitions and include directories that the FMU names, in
//! a temporary folder. Compiler options that it names are left out, since they may run programs.

use super::package;
use crate::file;
use crate::fmi::archive::ArchiveError;
use crate::fmi::description::FmiVersion;
use crate::fmi::sources::{self, Build, SourceError, SourceSet};
use crate::fmi::{Fmu, FmuError, binary, platform};
use pilotage_process::{Child, Ended, Folder};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Number of lines of a compiler that are shown.
const LINES: usize = 12;

/// Why sources could not be compiled.
#[derive(Debug, Error)]
pub enum CompileError {
    /// The FMU cannot be read.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// An entry is damaged.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The sources cannot be compiled.
    #[error("{}", path.display())]
    Sources {
        /// The FMU.
        path: std::path::PathBuf,
        /// Why.
        source: SourceError,
    },
    /// A file that is named is not there, or not in C.
    #[error("`{0}` is named as a source file, but {1}")]
    File(String, &'static str),
    /// The temporary folder.
    #[error("the temporary folder cannot be used")]
    Folder(#[from] io::Error),
    /// The compiler could not be started.
    #[error("the compiler `{command}` cannot be started")]
    NoCompiler {
        /// Its command.
        command: String,
        /// Why.
        source: io::Error,
    },
    /// The compiler refused a file.
    #[error("{what} failed ({ended}):")]
    Refused {
        /// What was done.
        what: String,
        /// How the compiler ended.
        ended: String,
        /// Its first lines.
        lines: String,
    },
    /// The compiler takes too long.
    #[error("the compiler was stopped after {0} s")]
    Late(f64),
    /// The library is none for this machine and FMI.
    #[error("the library that was made cannot be used: {0}")]
    Library(String),
    /// The archive cannot be written.
    #[error(transparent)]
    Export(#[from] super::ExportError),
}

/// A compiler, and the time that it may take.
#[derive(Debug, Clone)]
pub struct Compiler {
    /// The program, and arguments before all others.
    pub command: Vec<String>,
    /// Time limit \[s\] of all calls together.
    pub limit: f64,
}

/// How the libraries of an FMU are made.
///
/// # Errors
/// If it names no sources, or what cannot be compiled safely.
pub fn plan(fmu: &mut Fmu) -> Result<Vec<Build>, CompileError> {
    let has_description = fmu.files().any(|file| file == sources::DESCRIPTION);
    let build = match has_description {
        true => Some(fmu.read(sources::DESCRIPTION)?),
        false => None,
    };
    let text = build.map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let builds = sources::builds(fmu.description(), text.as_deref());
    let builds = builds.map_err(|source| CompileError::Sources {
        path: fmu.path().to_owned(),
        source,
    })?;
    let there: Vec<&str> = fmu.files().collect();
    for file in builds
        .iter()
        .flat_map(|own| &own.sets)
        .flat_map(|set| &set.files)
    {
        let entry = format!("{}{file}", sources::FOLDER);
        if !there.contains(&entry.as_str()) {
            return Err(CompileError::File(file.clone(), "it is not in the FMU"));
        }
        if !file.to_ascii_lowercase().ends_with(".c") {
            return Err(CompileError::File(
                file.clone(),
                "it is not in C, the language that is compiled here",
            ));
        }
    }
    Ok(builds)
}

/// The FMU with a library for this machine in addition to all that it has.
///
/// # Errors
/// If the compiler fails, or its result cannot be used.
pub fn compile(
    fmu: &mut Fmu,
    builds: &[Build],
    compiler: &Compiler,
) -> Result<Vec<u8>, CompileError> {
    let names: Vec<String> = fmu.files().map(str::to_owned).collect();
    let mut entries = BTreeMap::new();
    for name in names {
        let content = fmu.read(&name)?;
        entries.insert(name, content);
    }
    let folder = Folder::create()?;
    unpack(&entries, folder.path())?;
    let version = fmu.version();
    let headers = folder.path().join("standard");
    fs::create_dir(&headers)?;
    for (name, text) in headers_of(version) {
        fs::write(headers.join(name), text)?;
    }
    let run = Run {
        compiler,
        folder: folder.path(),
        version,
        begin: Instant::now(),
    };
    let place = match version {
        FmiVersion::V2 => platform::folders().into_iter().next_back(),
        FmiVersion::V3 => platform::folders().into_iter().next(),
    };
    let place = place
        .ok_or_else(|| CompileError::Library("FMI has no name for this machine".to_owned()))?;
    for build in builds {
        let library = run.build(build)?;
        let name = platform::library_name(&build.model_identifier);
        entries.insert(format!("binaries/{place}/{name}"), library);
    }
    Ok(package::zipped(entries)?)
}

/// Writes the sources, and the resources that they may include.
fn unpack(entries: &BTreeMap<String, Vec<u8>>, folder: &Path) -> io::Result<()> {
    for (name, content) in entries
        .iter()
        .filter(|(name, _)| name.starts_with(sources::FOLDER))
    {
        let path = folder.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::write(path, content)?;
    }
    Ok(())
}

/// The compilation of one FMU.
struct Run<'r> {
    compiler: &'r Compiler,
    folder: &'r Path,
    version: FmiVersion,
    begin: Instant,
}

impl Run<'_> {
    /// Makes a library and gives its bytes.
    fn build(&self, build: &Build) -> Result<Vec<u8>, CompileError> {
        let sources = self.folder.join(sources::FOLDER);
        let mut objects = Vec::new();
        for set in &build.sets {
            for file in &set.files {
                let object = self.folder.join(format!("{}.o", objects.len()));
                let mut command = self.command();
                command
                    .args(["-c", "-O2", "-fPIC"])
                    .args(self.settings(set))
                    .arg("-o")
                    .arg(&object);
                command.arg(sources.join(file));
                self.call(command, &format!("compiling `{file}`"))?;
                objects.push(object);
            }
        }
        let library = self.folder.join("library");
        let mut command = self.command();
        command
            .arg("-shared")
            .arg("-o")
            .arg(&library)
            .args(&objects);
        // The mathematical functions, which many forget to name, are a library of their own on some systems.
        let needed = build
            .libraries
            .iter()
            .map(String::as_str)
            .filter(|own| *own != "m");
        command
            .args(needed.map(|own| format!("-l{own}")))
            .args((!cfg!(windows)).then_some("-lm"))
            // What is nowhere defined is told here, instead of where the FMU is loaded.
            .args(cfg!(target_os = "linux").then_some("-Wl,-z,defs"));
        self.call(command, "linking")?;
        let bytes = file::bytes(&library)?;
        check(&bytes, self.version).map_err(CompileError::Library)?;
        Ok(bytes)
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.compiler.command[0]);
        command.args(&self.compiler.command[1..]);
        command
    }

    /// Definitions and include directories; headers of the standard come last, so that those of the FMU win.
    fn settings(&self, set: &SourceSet) -> Vec<String> {
        let sources = self.folder.join(sources::FOLDER);
        let number = match self.version {
            FmiVersion::V2 => 2,
            FmiVersion::V3 => 3,
        };
        let mut settings = vec![
            format!("-DFMI{number}_OVERRIDE_FUNCTION_PREFIX"),
            format!("-I{}", sources.display()),
        ];
        settings.extend(
            set.includes
                .iter()
                .map(|own| format!("-I{}", sources.join(own).display())),
        );
        settings.extend(set.definitions.iter().map(|(name, value)| match value {
            Some(value) => format!("-D{name}={value}"),
            None => format!("-D{name}"),
        }));
        settings.push(format!(
            "-idirafter{}",
            self.folder.join("standard").display()
        ));
        settings
    }

    /// Calls the compiler, in a process group that ends with it.
    fn call(&self, mut command: Command, what: &str) -> Result<(), CompileError> {
        let said = self.folder.join("said");
        let file = File::create(&said)?;
        command
            .stdin(Stdio::null())
            .stdout(file.try_clone()?)
            .stderr(file)
            .current_dir(self.folder);
        let left =
            Duration::from_secs_f64(self.compiler.limit).saturating_sub(self.begin.elapsed());
        let started = Child::start(command, true).map_err(|source| CompileError::NoCompiler {
            command: self.compiler.command.join(" "),
            source,
        });
        match started?.wait(Some(left), Duration::ZERO, |_| {})? {
            Ended::Early(status) if status.success() => Ok(()),
            Ended::Late => Err(CompileError::Late(self.compiler.limit)),
            Ended::Early(status) => Err(self.refused(what, &status.to_string(), &said)),
            Ended::Done { code, .. } => {
                Err(self.refused(what, &format!("exit code {code}"), &said))
            }
        }
    }

    fn refused(&self, what: &str, ended: &str, said: &Path) -> CompileError {
        let text = file::bytes(said)
            .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
            .unwrap_or_default();
        // Its own folder says nothing to anybody.
        let own = format!("{}/", self.folder.display());
        let lines: Vec<String> = (text.lines().take(LINES))
            .map(|line| {
                line.replace(&own, "")
                    .chars()
                    .filter(|own| !own.is_control())
                    .collect()
            })
            .collect();
        CompileError::Refused {
            what: what.to_owned(),
            ended: ended.to_owned(),
            lines: lines.join("\n"),
        }
    }
}

/// Refuses what is no library for this machine with functions of FMI.
fn check(bytes: &[u8], version: FmiVersion) -> Result<(), String> {
    binary::check(bytes).map_err(|error| error.to_string())?;
    let file = object::File::parse(bytes).map_err(|error| error.to_string())?;
    let exported = binary::exported(&file).map_err(|error| error.to_string())?;
    let needed = match version {
        FmiVersion::V2 => "fmi2GetVersion",
        FmiVersion::V3 => "fmi3GetVersion",
    };
    if exported.contains(needed.as_bytes()) {
        return Ok(());
    }
    let other = exported.iter().find(|own| own.ends_with(needed.as_bytes()));
    Err(match other {
        Some(own) => format!(
            "its functions have a prefix, as in {}",
            String::from_utf8_lossy(own)
        ),
        None => format!("it has no function {needed}"),
    })
}

/// Headers with the names of the standard (FMI 2.0.5, section 2.1; FMI 3.0, section 2.2), for sources that bring none.
fn headers_of(version: FmiVersion) -> [(String, String); 3] {
    let (number, types, own, table, others) = match version {
        FmiVersion::V2 => (
            2,
            include_str!("headers/fmi2_types.h"),
            include_str!("headers/fmi2_functions.h"),
            include_str!("headers/fmi2.txt"),
            "TypesPlatform",
        ),
        FmiVersion::V3 => (
            3,
            include_str!("headers/fmi3_types.h"),
            include_str!("headers/fmi3_functions.h"),
            include_str!("headers/fmi3.txt"),
            "PlatformTypes",
        ),
    };
    let guarded = |name: &str, text: String| {
        (
            format!("fmi{number}{name}.h"),
            format!("#ifndef fmi{number}{name}_h\n#define fmi{number}{name}_h\n{text}#endif\n"),
        )
    };
    let mut pointers = format!("#include \"fmi{number}{others}.h\"\n{own}");
    let mut functions = format!(
        "#include \"fmi{number}FunctionTypes.h\"\n\
         #if defined(FMI{number}_FUNCTION_PREFIX) && !defined(FMI{number}_OVERRIDE_FUNCTION_PREFIX)\n\
         #define fmi{number}Paste(a, b) a##b\n#define fmi{number}PasteB(a, b) fmi{number}Paste(a, b)\n\
         #define fmi{number}FullName(name) fmi{number}PasteB(FMI{number}_FUNCTION_PREFIX, name)\n\
         #else\n#define fmi{number}FullName(name) name\n#endif\n\
         #ifndef FMI{number}_Export\n#if defined _WIN32 || defined __CYGWIN__\n\
         #define FMI{number}_Export __declspec(dllexport)\n#else\n\
         #define FMI{number}_Export __attribute__((visibility(\"default\")))\n#endif\n#endif\n\
         #ifdef __cplusplus\nextern \"C\" {{\n#endif\n"
    );
    for line in table.lines() {
        let Some((head, arguments)) = line.split_once(" (") else {
            continue;
        };
        let Some((result, name)) = head.rsplit_once(' ') else {
            continue;
        };
        let name = format!("fmi{number}{name}");
        pointers += &format!("typedef {result} {name}TYPE ({arguments};\n");
        functions += &format!(
            "#define {name} fmi{number}FullName({name})\nFMI{number}_Export {name}TYPE {name};\n"
        );
    }
    functions += "#ifdef __cplusplus\n}\n#endif\n";
    [
        guarded(others, types.to_owned()),
        guarded("FunctionTypes", pointers),
        guarded("Functions", functions),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use pilotage_abi::{fmi2, fmi3};

    #[test]
    fn headers_have_each_function_once() {
        let all = |version| headers_of(version).map(|(_, text)| text).concat();
        let names2: Vec<&str> = fmi2::Function::ALL.iter().map(|own| own.name()).collect();
        let names3: Vec<&str> = fmi3::Function::ALL.iter().map(|own| own.name()).collect();
        for (text, names) in [(all(FmiVersion::V2), names2), (all(FmiVersion::V3), names3)] {
            assert_eq!(text.matches("TYPE (").count(), names.len());
            for name in names {
                assert_eq!(text.matches(&format!(" {name}TYPE (")).count(), 1, "{name}");
            }
        }
    }
}
