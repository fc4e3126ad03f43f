//! A component's inputs and outputs, and data on both within a step.

use super::change::Change;
use super::history::Outcome;
use crate::component::{Abilities, Component, Conversion, Role, Value, ValueKind};
use crate::report::CouplingError;
use std::ops::Range;

/// A connection as seen by the component with the input.
pub(super) struct Wire {
    /// Handle of the input.
    pub(super) handle: u32,
    /// Slot that feeds it: in the row if both ends are reals, otherwise in [`Values::others`](super::wired::Values).
    pub(super) slot: usize,
    /// Names of both ends: `` `a.y` -> `b.u` ``.
    pub(super) name: String,
    /// For reals: the output's position among all fed outputs, and the unit conversion.
    pub(super) real: Option<(usize, Conversion)>,
}

/// The connected inputs.
pub(super) struct Inputs {
    /// For reals: handles, and slots in the row and positions among all fed outputs of the outputs that feed them.
    pub(super) handles: Vec<u32>,
    pub(super) slots: Vec<usize>,
    pub(super) positions: Vec<usize>,
    /// These positions, each once: an output may feed several inputs of a component.
    pub(super) distinct: Vec<usize>,
    /// Buffers for values and slopes.
    pub(super) values: Vec<f64>,
    pub(super) slopes: Vec<f64>,
    /// Positions of values with a unit conversion.
    pub(super) conversions: Vec<(usize, Conversion)>,
    /// Handles of non-real inputs, and their slots in [`Values::others`](super::wired::Values).
    pub(super) others: Vec<(u32, usize)>,
    /// Names of both ends of their wires.
    pub(super) other_names: Vec<String>,
}

impl Inputs {
    pub(super) fn new(wires: &[Wire]) -> Self {
        let reals = || (wires.iter()).filter_map(|wire| Some((wire, wire.real?)));
        let others = wires.iter().filter(|wire| wire.real.is_none());
        let conversions = reals().map(|(_, (_, conversion))| conversion).enumerate();
        let positions: Vec<usize> = reals().map(|(_, (position, _))| position).collect();
        let is_first = |&(k, p): &(usize, &usize)| !positions[..k].contains(p);
        let distinct = positions.iter().enumerate().filter(is_first);
        let distinct = distinct.map(|(_, &p)| p).collect();
        let n = positions.len();
        Self {
            handles: reals().map(|(wire, _)| wire.handle).collect(),
            slots: reals().map(|(wire, _)| wire.slot).collect(),
            positions,
            distinct,
            values: vec![0.0; n],
            slopes: vec![0.0; n],
            conversions: conversions
                .filter(|(_, conversion)| *conversion != Conversion::NONE)
                .collect(),
            others: others.clone().map(|w| (w.handle, w.slot)).collect(),
            other_names: others.map(|wire| wire.name.clone()).collect(),
        }
    }

    /// Whether any real input is connected.
    pub(super) fn are_fed(&self) -> bool {
        !self.handles.is_empty()
    }

    /// Whether inputs that change within a step are held piecewise.
    pub(super) fn have_hold_error(&self, abilities: Abilities) -> bool {
        self.are_fed() && !abilities.input_derivatives && abilities.rollback
    }
}

/// An output that is read separately.
pub(super) struct Reading {
    pub(super) handle: u32,
    pub(super) kind: ValueKind,
    /// Type to which it is converted.
    pub(super) wanted: ValueKind,
    /// Values with others in their place, which have that type.
    pub(super) map: Vec<(Value, Value)>,
    /// Slot in [`Values::others`](super::wired::Values).
    pub(super) slot: usize,
    /// Names of both ends of the wire that needs this conversion, if any.
    pub(super) wire: String,
}

/// Values read from a component, and their slots.
pub(super) struct Outlets {
    /// Handles of the real outputs.
    pub(super) handles: Vec<u32>,
    /// Their slots in the row.
    pub(super) slots: Range<usize>,
    /// The non-real outputs, and outputs that feed inputs of another type.
    pub(super) others: Vec<Reading>,
}

/// The outputs.
pub(super) struct Outputs {
    /// Handles of the real outputs, and their slots in the row.
    pub(super) handles: Vec<u32>,
    pub(super) slots: Range<usize>,
    /// Slots of the outputs that feed inputs, and their positions among all fed outputs.
    pub(super) fed: Vec<usize>,
    pub(super) fed_positions: Vec<usize>,
    /// Slots of the fed outputs, and their changes between communication points.
    pub(super) changes: Vec<(usize, Change)>,
    /// The non-real outputs, and outputs that feed inputs of another type.
    pub(super) others: Vec<Reading>,
    /// Handles and slots of real outputs without direct feedthrough from a connected input, and a buffer for their
    /// values; indices of `others` without direct feedthrough.
    pub(super) settled: Vec<u32>,
    pub(super) settled_slots: Vec<usize>,
    pub(super) settled_values: Vec<f64>,
    pub(super) settled_others: Vec<usize>,
    /// Whether any output, and any fed output, has direct feedthrough from a connected input.
    pub(super) has_feedthrough: bool,
    pub(super) feeds_through: bool,
}

impl Outputs {
    /// The outputs of a component with these connected inputs (positions of variables); `fed` are the slots of all
    /// outputs that feed inputs.
    pub(super) fn new(
        outlets: Outlets,
        component: &dyn Component,
        fed_inputs: &[usize],
        fed: &[usize],
    ) -> Self {
        let is_direct = |handle: u32, kind: ValueKind| {
            let mut variables = component.variables().iter();
            variables
                .find(|v| v.handle == handle && v.role == Role::Output && v.kind == kind)
                .is_some_and(|v| v.feedthrough.iter().any(|input| fed_inputs.contains(input)))
        };
        let Outlets {
            handles,
            slots,
            others,
        } = outlets;
        let own = fed.iter().enumerate();
        let (fed_positions, fed): (Vec<_>, Vec<_>) =
            own.filter(|(_, slot)| slots.contains(slot)).unzip();
        let reals = handles.iter().copied().zip(slots.clone());
        let (direct, settled): (Vec<_>, Vec<_>) =
            reals.partition(|(handle, _)| is_direct(*handle, ValueKind::Real));
        let is_settled = |k: &usize| !is_direct(others[*k].handle, others[*k].kind);
        let settled_others: Vec<usize> = (0..others.len()).filter(is_settled).collect();
        let (settled, settled_slots): (Vec<_>, Vec<_>) = settled.into_iter().unzip();
        Self {
            changes: fed.iter().map(|&slot| (slot, Change::default())).collect(),
            settled_values: vec![0.0; settled.len()],
            has_feedthrough: !direct.is_empty() || settled_others.len() < others.len(),
            feeds_through: direct.iter().any(|(_, slot)| fed.contains(slot)),
            handles,
            slots,
            fed,
            fed_positions,
            others,
            settled,
            settled_slots,
            settled_others,
        }
    }

    /// Handle of the real output in that slot.
    pub(super) fn handle(&self, slot: usize) -> u32 {
        self.handles[slot - self.slots.start]
    }
}

/// Error of an input's mean over a step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Defect {
    /// Best estimate; signed if observed.
    pub(super) size: f64,
    /// Conservative estimate, for step-size control.
    pub(super) careful: f64,
    /// Error if the output was observed within the step; otherwise 0.
    pub(super) seen: f64,
    /// If it was not observed: possible error if slopes are unreliable; otherwise 0.
    pub(super) unseen: f64,
}

/// Coupling data within a step: for the fed outputs and the inputs.
pub(super) struct Within {
    /// Handles of the fed outputs whose derivatives are read too, and a buffer for these.
    pub(super) sloped: Vec<u32>,
    pub(super) slope_values: Vec<f64>,
    /// Whether these outputs can be observed within a step; the last observation, that in the middle, and points at
    /// which they differed from the middle.
    pub(super) is_watchable: bool,
    pub(super) looked: Vec<Outcome>,
    pub(super) middle: Vec<Outcome>,
    pub(super) astray: Vec<Option<(f64, Outcome)>>,
    pub(super) look_values: Vec<f64>,
    /// Means over the last step of the values given to the inputs, in the outputs' units.
    pub(super) used: Vec<f64>,
    /// Errors of these means.
    pub(super) defects: Vec<Defect>,
    /// Integral of the error of each mean since the clock's last point.
    pub(super) gathered: Vec<f64>,
    /// Error of each mean: integral of the magnitude, and largest magnitude over a clock step. Not used if inputs are
    /// only held.
    pub(super) errors: Vec<CouplingError>,
}

impl Within {
    /// `reads_slopes`: whether the derivatives of the fed outputs are used and available.
    pub(super) fn new(
        inputs: &Inputs,
        outputs: &Outputs,
        reads_slopes: bool,
        abilities: Abilities,
        parts: u32,
    ) -> Self {
        let (n, fed) = (inputs.handles.len(), &outputs.fed[..]);
        let fed = if reads_slopes { fed } else { &[] };
        let sloped: Vec<u32> = fed.iter().map(|&slot| outputs.handle(slot)).collect();
        let looks = sloped.len();
        Self {
            slope_values: vec![0.0; looks],
            is_watchable: looks > 0 && can_be_watched(inputs, outputs, abilities, parts),
            looked: vec![Outcome::default(); looks],
            middle: vec![Outcome::default(); looks],
            astray: vec![None; looks],
            look_values: vec![0.0; looks],
            sloped,
            used: vec![0.0; n],
            defects: vec![Defect::default(); n],
            gathered: vec![0.0; n],
            errors: vec![CouplingError::default(); n],
        }
    }

    /// Goes on without the derivatives of the outputs.
    pub(super) fn forget_slopes(&mut self) {
        self.sloped.clear();
        self.slope_values.clear();
        self.is_watchable = false;
    }
}

/// Whether outputs within a step equal those at the end of a shorter step: the component supports such steps and linear
/// inputs, and its outputs depend on the inputs only through its states.
fn can_be_watched(inputs: &Inputs, outputs: &Outputs, abilities: Abilities, parts: u32) -> bool {
    let follows = !inputs.are_fed() || abilities.input_derivatives;
    let can_go_there = abilities.rollback && abilities.variable_steps;
    can_go_there && follows && parts == 1 && !outputs.feeds_through
}
