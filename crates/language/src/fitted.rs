//! The table `[fit]` of a model file: which fit its start values come from, and what there is to doubt. The equations do not
//! depend on it.

use pilotage_text::document::{DocumentError, TomlTable};

/// The table in which a fit says how it ended.
pub const TITLE: &str = "fit";

/// The fit that a model's start values come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fitted {
    /// How it ended.
    pub status: String,
    /// False for the best iterate of a fit that has no answer.
    pub converged: bool,
    /// Code and words of each diagnostic.
    pub doubts: Vec<(String, String)>,
}

impl Fitted {
    /// What a user must know before relying on the model; `None` if there is nothing.
    pub fn caveat(&self) -> Option<String> {
        let unconverged =
            "The fit did NOT converge: the start values are its best iterate, not a solution.";
        let unconverged = (!self.converged).then(|| unconverged.to_owned());
        let doubts = self
            .doubts
            .iter()
            .map(|(_, words)| format!("Diagnostic: {words}."));
        let all: Vec<String> = unconverged.into_iter().chain(doubts).collect();
        (!all.is_empty()).then(|| all.join(" "))
    }

    /// Reads the table of a file, if it has one.
    ///
    /// # Errors
    /// If a field is unknown, is missing or has another type.
    pub(crate) fn read(root: TomlTable<'_>) -> Result<Option<Self>, DocumentError> {
        let Some(table) = root.table(TITLE)? else {
            return Ok(None);
        };
        table.only(&[
            "tool",
            "problem",
            "posed",
            "instance",
            "status",
            "converged",
            "objective",
            "chi2",
            "nllh",
            "samples",
            "kkt",
            "tolerance",
            "scheme",
            "iterations",
            "seconds",
            "stable",
            "poles",
            "doubt",
            "data",
        ])?;
        let doubt = |own: &TomlTable<'_>| {
            own.only(&["code", "words"])?;
            let text =
                |key: &str| Ok::<_, DocumentError>(own.required(key, own.string(key)?)?.to_owned());
            Ok((text("code")?, text("words")?))
        };
        for own in table.tables("data")? {
            own.only(&["file", "sha256", "use", "weight", "subject"])?;
            own.string("sha256")?;
            own.required("file", own.string("file")?)?;
        }
        Ok(Some(Self {
            status: table
                .required("status", table.string("status")?)?
                .to_owned(),
            converged: table.required("converged", table.boolean("converged")?)?,
            doubts: table
                .tables("doubt")?
                .iter()
                .map(doubt)
                .collect::<Result<_, DocumentError>>()?,
        }))
    }
}
