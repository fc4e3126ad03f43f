//! What a component exchanges: its inputs, its outputs, and what is known of both within a step.

use super::change::Change;
use super::history::Outcome;
use crate::component::{Abilities, Component, Conversion, Role, ValueKind};
use crate::report::CouplingError;
use std::ops::Range;

/// A connection as the component sees it that has the input.
pub(super) struct Wire {
    /// Handle of the input.
    pub(super) handle: u32,
    /// Slot that feeds it: in the row where both ends are reals, else in [`Values::others`](super::wired::Values).
    pub(super) slot: usize,
    /// Both ends in words: `` `a.y` -> `b.u` ``.
    pub(super) name: String,
    /// Of reals: the output's position among all fed outputs, and how its values become the input's.
    pub(super) real: Option<(usize, Conversion)>,
}

/// The inputs that are fed.
pub(super) struct Inputs {
    /// Handles of the real ones, the row's slots and the positions among all fed outputs that feed them.
    pub(super) handles: Vec<u32>,
    pub(super) slots: Vec<usize>,
    pub(super) positions: Vec<usize>,
    /// Room for values and slopes.
    pub(super) values: Vec<f64>,
    pub(super) slopes: Vec<f64>,
    /// Which of the values come in another unit.
    pub(super) conversions: Vec<(usize, Conversion)>,
    /// Handles of those that are no reals, and their slots in [`Values::others`](super::wired::Values).
    pub(super) others: Vec<(u32, usize)>,
    /// Both ends of their wires in words.
    pub(super) other_names: Vec<String>,
}

impl Inputs {
    pub(super) fn new(wires: &[Wire]) -> Self {
        let reals = || (wires.iter()).filter_map(|wire| Some((wire, wire.real?)));
        let others = wires.iter().filter(|wire| wire.real.is_none());
        let conversions = reals().map(|(_, (_, conversion))| conversion).enumerate();
        let n = reals().count();
        Self {
            handles: reals().map(|(wire, _)| wire.handle).collect(),
            slots: reals().map(|(wire, _)| wire.slot).collect(),
            positions: reals().map(|(_, (position, _))| position).collect(),
            values: vec![0.0; n],
            slopes: vec![0.0; n],
            conversions: conversions
                .filter(|(_, conversion)| *conversion != Conversion::NONE)
                .collect(),
            others: others.clone().map(|w| (w.handle, w.slot)).collect(),
            other_names: others.map(|wire| wire.name.clone()).collect(),
        }
    }

    /// Whether reals are fed.
    pub(super) fn are_fed(&self) -> bool {
        !self.handles.is_empty()
    }

    /// Whether those that change within a step become staircases.
    pub(super) fn have_hold_error(&self, abilities: Abilities) -> bool {
        self.are_fed() && !abilities.input_derivatives && abilities.rollback
    }
}

/// An output that is read by itself.
pub(super) struct Reading {
    pub(super) handle: u32,
    pub(super) kind: ValueKind,
    /// Type that it is wanted in.
    pub(super) wanted: ValueKind,
    /// Slot in [`Values::others`](super::wired::Values).
    pub(super) slot: usize,
    /// Both ends in words of the wire that wants it in that type, if one does.
    pub(super) wire: String,
}

/// What is read of a component, and where it goes.
pub(super) struct Outlets {
    /// Handles of the real outputs.
    pub(super) handles: Vec<u32>,
    /// Their slots in the row.
    pub(super) slots: Range<usize>,
    /// The other outputs, and those that feed inputs of another type.
    pub(super) others: Vec<Reading>,
}

/// The outputs.
pub(super) struct Outputs {
    /// Handles of the real ones, and where they go in the row.
    pub(super) handles: Vec<u32>,
    pub(super) slots: Range<usize>,
    /// Slots of those that feed others, and their positions among all fed outputs.
    pub(super) fed: Vec<usize>,
    pub(super) fed_positions: Vec<usize>,
    /// Their slots again, and how they change between communication points.
    pub(super) changes: Vec<(usize, Change)>,
    /// The others, and those that feed inputs of another type.
    pub(super) others: Vec<Reading>,
    /// Handles and slots of the real ones without direct feedthrough from a fed input, and room for their values;
    /// and which of the others have none.
    pub(super) settled: Vec<u32>,
    pub(super) settled_slots: Vec<usize>,
    pub(super) settled_values: Vec<f64>,
    pub(super) settled_others: Vec<usize>,
    /// Whether an output, or a fed one, has direct feedthrough from a fed input.
    pub(super) has_feedthrough: bool,
    pub(super) feeds_through: bool,
}

impl Outputs {
    /// Of a component of which these inputs (positions of variables) are fed; `fed` are the slots of all outputs that
    /// feed others.
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

    /// Handle of the real output of that slot.
    pub(super) fn handle(&self, slot: usize) -> u32 {
        self.handles[slot - self.slots.start]
    }
}

/// By how much the mean of an input over a step is wrong.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Defect {
    /// As well as it is known; with a sign if it was seen.
    pub(super) size: f64,
    /// With what it may be beside that, for steps that are to be short enough.
    pub(super) careful: f64,
    /// If the output was seen within the step, that; else 0.
    pub(super) seen: f64,
    /// If it was not, what it may be where slopes are no guide; else 0.
    pub(super) unseen: f64,
}

/// What is known of the coupling within a step: of the fed outputs, and of the inputs.
pub(super) struct Within {
    /// Handles of the fed outputs, if their derivatives are to be read too, and room for these.
    pub(super) sloped: Vec<u32>,
    pub(super) slope_values: Vec<f64>,
    /// Whether they can be seen within a step; what was seen of them last, in the middle, and where else they
    /// were others than there.
    pub(super) is_watchable: bool,
    pub(super) looked: Vec<Outcome>,
    pub(super) middle: Vec<Outcome>,
    pub(super) astray: Vec<Option<(f64, Outcome)>>,
    pub(super) look_values: Vec<f64>,
    /// Means over the last step of what the inputs were given, in the outputs' units.
    pub(super) used: Vec<f64>,
    /// By how much each of these means is wrong.
    pub(super) defects: Vec<Defect>,
    /// Integral of the error of each of these means since the last point of the clock.
    pub(super) gathered: Vec<f64>,
    /// Integral of the magnitude, and largest magnitude over a step of the clock, of the error of each of these
    /// means, where inputs are not just held.
    pub(super) errors: Vec<CouplingError>,
}

impl Within {
    /// `reads_slopes`: the derivatives of the fed outputs are wanted and known.
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
}

/// Whether the outputs within a step are what they are where a shorter step ends there: the component takes such steps,
/// and follows lines, of which its outputs show no more than its states do.
fn can_be_watched(inputs: &Inputs, outputs: &Outputs, abilities: Abilities, parts: u32) -> bool {
    let follows = !inputs.are_fed() || abilities.input_derivatives;
    let can_go_there = abilities.rollback && abilities.variable_steps;
    can_go_there && follows && parts == 1 && !outputs.feeds_through
}
