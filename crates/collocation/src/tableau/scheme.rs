//! The named schemes.

use std::collections::HashMap;
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use super::{Element, Tableau, bernstein, finite_difference, runge_kutta};

/// A collocation scheme.
///
/// [`Scheme::choices`] lists the permitted sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scheme {
    /// Forward Euler, explicit: the paper's matrix D.
    Euler,
    /// Trapezoid.
    Trapezoid,
    /// Hermite–Simpson; the midpoint state of an interval is an unknown.
    HermiteSimpson,
    /// Gauss–Legendre collocation with this number of stages.
    Gauss(usize),
    /// Radau IIA collocation with this number of stages.
    Radau(usize),
    /// Legendre pseudospectral on the LGL nodes, of this degree in each element: 1 is the trapezoid, 2 is
    /// Hermite–Simpson.
    Lobatto(usize),
    /// Bernstein polynomials of this degree in each element.
    Bernstein(usize),
    /// Finite differences with stencils of one more node than this.
    FiniteDifference(usize),
}

/// Schemes with a size.
struct Family {
    name: &'static str,
    of_size: fn(usize) -> Scheme,
    sizes: RangeInclusive<usize>,
}

/// Schemes without a size.
const SINGLE: [Scheme; 3] = [Scheme::Euler, Scheme::Trapezoid, Scheme::HermiteSimpson];

/// Families of schemes with a size.
static FAMILIES: [Family; 5] = [
    family("gauss", Scheme::Gauss, 10),
    family("radau", Scheme::Radau, 10),
    family("lgl", Scheme::Lobatto, 64),
    family("bernstein", Scheme::Bernstein, 12),
    family("finite-difference", Scheme::FiniteDifference, 8),
];

const fn family(name: &'static str, of_size: fn(usize) -> Scheme, largest: usize) -> Family {
    Family {
        name,
        of_size,
        sizes: 1..=largest,
    }
}

/// An unknown name of a scheme.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no scheme is called '{name}'; there are {}", Scheme::choices())]
pub struct UnknownScheme {
    /// The requested name.
    pub name: String,
}

impl Scheme {
    /// Its name, as on the command line.
    pub fn name(&self) -> String {
        self.to_string()
    }

    /// All names in words: `euler, .., gauss-1 to gauss-10, ..`.
    pub fn choices() -> String {
        let single = SINGLE.iter().map(Scheme::name);
        let sized = FAMILIES.iter().map(|family| {
            let (first, last) = (family.sizes.start(), family.sizes.end());
            format!("{0}-{first} to {0}-{last}", family.name)
        });
        single.chain(sized).collect::<Vec<_>>().join(", ")
    }

    /// Order of convergence of the states at the ends of elements (finite differences: at the nodes), for
    /// smooth solutions.
    pub fn order(&self) -> usize {
        match *self {
            Self::Euler => 1,
            Self::Trapezoid => 2,
            Self::HermiteSimpson => 4,
            Self::Gauss(s) => 2 * s,
            Self::Radau(s) => 2 * s - 1,
            Self::Lobatto(n) => 2 * n,
            Self::Bernstein(d) => d,
            Self::FiniteDifference(p) => p,
        }
    }

    /// Order of convergence of [`Tableau::interpolate`] between the ends. Below [`Scheme::order`] for schemes with many
    /// stages, which converge faster at the ends.
    pub fn interpolant_order(&self) -> usize {
        (self.degree() + 1).min(self.order())
    }

    /// Degree of the polynomials of [`Tableau::interpolate`]; their local error decreases with one power more of the
    /// element length.
    pub fn degree(&self) -> usize {
        match *self {
            Self::Euler => 1,
            Self::Trapezoid => 2,
            Self::HermiteSimpson => 3,
            // Integral of the polynomial through f at the points.
            Self::Gauss(s) | Self::Radau(s) => s,
            Self::Lobatto(n) => n + 1,
            Self::Bernstein(d) => d,
            Self::FiniteDifference(p) => p,
        }
    }

    /// Reference for the scheme.
    pub fn source(&self) -> &'static str {
        match self {
            Self::Euler => "Bonner & Kirchner 2026, matrix D",
            Self::Trapezoid => {
                "Betts, Practical Methods for Optimal Control, 2nd ed. 2010, eq. 3.109"
            }
            Self::HermiteSimpson => {
                "Betts 2010, eqs. 4.146-4.147; Hairer & Wanner II, table 5.7 (Lobatto IIIA, s = 3)"
            }
            Self::Gauss(_) => "Hairer & Wanner II, section IV.5 (Gauss)",
            Self::Radau(_) => "Hairer & Wanner II, section IV.5 (Radau IIA)",
            Self::Lobatto(_) => {
                "Elnagar, Kazemi & Razzaghi, IEEE TAC 40(10), 1995; in integral form: Hairer & Wanner II, \
                 section IV.5 (Lobatto IIIA)"
            }
            Self::Bernstein(_) => {
                "Cichella, Kaminer, Walton, Hovakimyan & Pascoal, arXiv:1812.06132, 2018"
            }
            Self::FiniteDifference(_) => {
                "Fornberg, Math. Comp. 51, 1988; stencils: Brugnano & Trigiante 1998, chapter 5 (GBDF)"
            }
        }
    }

    /// The elements of a run whose mesh has these boundaries \[s\], strictly increasing; none for fewer than two
    /// boundaries.
    ///
    /// # Panics
    ///
    /// If the size is not among [`Scheme::choices`]; parsing a name checks it.
    pub fn elements(&self, mesh: &[f64]) -> Vec<Element> {
        self.check_size();
        let intervals = mesh.len().saturating_sub(1);
        if intervals == 0 {
            return Vec::new();
        }
        if let Self::FiniteDifference(p) = *self {
            let tableau = Arc::new(finite_difference::finite_difference(p, mesh));
            let first = 0;
            return vec![Element {
                first,
                intervals,
                tableau,
            }];
        }
        let tableau = self.shared();
        let element = |first| Element {
            first,
            intervals: 1,
            tableau: tableau.clone(),
        };
        (0..intervals).map(element).collect()
    }

    /// The tableau of a scheme with identical elements, created once for all runs.
    fn shared(&self) -> Arc<Tableau> {
        static MADE: LazyLock<Mutex<HashMap<Scheme, Arc<Tableau>>>> = LazyLock::new(Mutex::default);
        // Entries are inserted completely or not at all, so the map stays valid even if poisoned.
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        made.entry(*self)
            .or_insert_with(|| Arc::new(self.tableau()))
            .clone()
    }

    fn tableau(&self) -> Tableau {
        match *self {
            Self::Euler => runge_kutta::euler(),
            Self::Trapezoid => runge_kutta::trapezoid(),
            Self::HermiteSimpson => runge_kutta::hermite_simpson(),
            Self::Gauss(s) => runge_kutta::gauss(s),
            Self::Radau(s) => runge_kutta::radau(s),
            Self::Lobatto(n) => runge_kutta::lobatto(n),
            Self::Bernstein(d) => bernstein::bernstein(d),
            Self::FiniteDifference(_) => unreachable!("its tableau is one of a mesh"),
        }
    }

    /// Its family and size; None for schemes without a size.
    fn sized(&self) -> Option<(&'static Family, usize)> {
        let size = match *self {
            Self::Gauss(n)
            | Self::Radau(n)
            | Self::Lobatto(n)
            | Self::Bernstein(n)
            | Self::FiniteDifference(n) => n,
            _ => return None,
        };
        let family = FAMILIES.iter().find(|f| (f.of_size)(size) == *self)?;
        Some((family, size))
    }

    fn check_size(&self) {
        if let Some((family, size)) = self.sized() {
            assert!(
                family.sizes.contains(&size),
                "{}",
                UnknownScheme { name: self.name() }
            );
        }
    }
}

impl fmt::Display for Scheme {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((family, size)) = self.sized() {
            return f.pad(&format!("{}-{size}", family.name));
        }
        f.pad(match self {
            Self::Euler => "euler",
            Self::Trapezoid => "trapezoid",
            _ => "hermite-simpson",
        })
    }
}

impl FromStr for Scheme {
    type Err = UnknownScheme;

    fn from_str(name: &str) -> Result<Self, UnknownScheme> {
        let sized = || {
            let (family, size) = name.rsplit_once('-')?;
            let family = FAMILIES.iter().find(|f| f.name == family)?;
            let size = size.parse().ok()?;
            let scheme = (family.of_size)(size);
            (family.sizes.contains(&size) && scheme.name() == name).then_some(scheme)
        };
        let single = SINGLE.into_iter().find(|scheme| scheme.name() == name);
        single.or_else(sized).ok_or_else(|| UnknownScheme {
            name: name.to_owned(),
        })
    }
}

/// All named schemes.
#[cfg(test)]
pub(super) fn every_scheme() -> Vec<Scheme> {
    let sized = FAMILIES.iter().flat_map(|f| f.sizes.clone().map(f.of_size));
    SINGLE.into_iter().chain(sized).collect()
}
