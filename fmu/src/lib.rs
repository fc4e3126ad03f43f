//! The shared library inside every FMU that pilotage exports: FMI 2.0 and FMI 3.0, co-simulation and
//! model exchange.
//!
//! One library serves every model: the FMU's `resources/model.toml` states the model and its start values. It may be a
//! user's model file, so that exporting needs no compiler. Everything else is in [`pilotage_sdk`].

pilotage_sdk::export!(
    pilotage_models::AnyModel,
    pilotage_models::AnyModel::from_resources
);
