//! Symbols and libraries that an FMU's library needs and the system lacks, with suggestions.

use std::fmt;

/// A dependency of a library that is missing on this system.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Missing {
    /// A function or variable of another library.
    Symbol(String),
    /// Another library.
    Library(String),
}

impl Missing {
    /// Parses the error messages of the loaders of Linux and macOS.
    pub(super) fn in_message(text: &str) -> Option<Self> {
        const SYMBOLS: [&str; 2] = ["undefined symbol: ", "symbol not found in flat namespace "];
        const LIBRARY: &str = ": cannot open shared object file";
        let word = |text: &str| {
            let end = text.find([',', ' ', '\n', ')']).unwrap_or(text.len());
            text[..end].trim_matches('\'').to_owned()
        };
        let symbol = SYMBOLS.iter().find_map(|before| text.split_once(before));
        if let Some((_, symbol)) = symbol {
            return Some(Self::Symbol(word(symbol)));
        }
        if let Some((_, library)) = text.split_once("Library not loaded: ") {
            return Some(Self::Library(word(library)));
        }
        let (before, _) = text.split_once(LIBRARY)?;
        let name = before.rsplit(' ').next().unwrap_or(before);
        Some(Self::Library(name.to_owned()))
    }

    /// Whether it belongs to the Python interpreter, which FMUs of PythonFMU and similar tools expect in the host.
    fn is_python(&self) -> bool {
        match self {
            Self::Symbol(name) => name.starts_with("Py") || name.starts_with("_Py"),
            Self::Library(name) => name.starts_with("libpython"),
        }
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Symbol(name) => {
                write!(f, "no library here has the symbol `{name}` that it needs; ")?
            }
            Self::Library(name) => write!(f, "the library `{name}` that it needs is not here; ")?,
        }
        f.write_str(match self {
            Self::Symbol(_) if self.is_python() => {
                "it is of Python, in which such FMUs usually run: start with \
                 LD_PRELOAD=libpython3.12.so, or of the version that the FMU was made for"
            }
            Self::Library(_) if self.is_python() => {
                "install that version of Python with its shared library, or add its folder to LD_LIBRARY_PATH"
            }
            Self::Symbol(_) => {
                "the FMU was linked without the library that has it: start with LD_PRELOAD=LIBRARY, or ask who \
                 made the FMU"
            }
            Self::Library(_) => {
                "install the package that has it, or add its folder to LD_LIBRARY_PATH"
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Missing;

    #[test]
    fn messages_of_loaders() {
        let symbol = |name: &str| Some(Missing::Symbol(name.to_owned()));
        let library = |name: &str| Some(Missing::Library(name.to_owned()));
        for (text, missing) in [
            (
                "/t/a.so: undefined symbol: _Py_NoneStruct",
                symbol("_Py_NoneStruct"),
            ),
            ("/t/a.so: undefined symbol: f, version GLIBC_9", symbol("f")),
            (
                "libgfortran.so.5: cannot open shared object file: No such file or directory",
                library("libgfortran.so.5"),
            ),
            (
                "dlopen(a.dylib, 0x0002): symbol not found in flat namespace '_f'",
                symbol("_f"),
            ),
            (
                "dlopen(a.dylib, 0x0002): Library not loaded: @rpath/b.dylib\n  Reason: none",
                library("@rpath/b.dylib"),
            ),
            ("/t/a.so: file too short", None),
        ] {
            assert_eq!(Missing::in_message(text), missing, "{text}");
        }
    }
}
