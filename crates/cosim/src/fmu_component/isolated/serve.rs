//! The process of an isolated FMU: answers questions one after another.

use super::wire::{self, Answer, Asked, Question, Wanted};
use crate::component::{Component, ComponentError, Progress};
use crate::fmu_component;
use pilotage_fmi::InterfaceType;
use pilotage_process::{Channel, Spoiled};
use std::io;
use std::path::{Path, PathBuf};

/// Answers until the component is freed. The process ends with its parent ([`pilotage_process::end_with_parent`]).
///
/// # Errors
/// If the channel cannot be opened.
pub fn serve(channel: &Path) -> io::Result<()> {
    let channel = Channel::open(channel)?;
    let mut served = Served {
        component: None,
        reals: Vec::new(),
        time: f64::NEG_INFINITY,
    };
    let (mut question, mut bytes) = (Vec::new(), Vec::new());
    let wait = || Ok::<(), Spoiled>(());
    loop {
        // The other side detects and reports that the memory is spoiled.
        if channel.receive(&mut question, wait) == Err(Spoiled) {
            return Ok(());
        }
        let asked = wire::read::<Asked<'_>>(&question);
        let is_last = (asked.as_ref()).is_ok_and(|asked| matches!(asked.question, Question::Free));
        let answer = asked.and_then(|asked| served.answer(asked));
        let answer = answer.unwrap_or_else(|error| Answer::Failed(wire::words(error.as_ref())));
        let is_written = wire::write(&answer, &mut bytes);
        if let Err(error) = is_written {
            let failed = Answer::Failed(wire::words(error.as_ref()));
            wire::write(&failed, &mut bytes)
                .map_err(|error| io::Error::other(error.to_string()))?;
        }
        // Reuses the buffer of the answer.
        if let Answer::Reals(reals) | Answer::Moved(.., Some(reals)) = answer {
            served.reals = reals;
        }
        if channel.send(&bytes, wait) == Err(Spoiled) || is_last {
            return Ok(());
        }
    }
}

struct Served {
    component: Option<Box<dyn Component>>,
    /// Buffer for reals.
    reals: Vec<f64>,
    /// Current time \[s\].
    time: f64,
}

impl Served {
    fn answer(&mut self, asked: Asked<'_>) -> Result<Answer, ComponentError> {
        let question = asked.question;
        if let Question::Open { path, name, wanted } = question {
            let wanted = wanted.map(|wanted| match wanted {
                Wanted::CoSimulation => InterfaceType::CoSimulation,
                Wanted::ModelExchange => InterfaceType::ModelExchange,
            });
            self.component = Some(fmu_component::open(&path_of(&path), &name, wanted)?);
            return Ok(Answer::Done);
        }
        if matches!(question, Question::Free) {
            self.component = None;
            return Ok(Answer::Done);
        }
        let mut reals = std::mem::take(&mut self.reals);
        let own = self.component.as_mut().ok_or("there is no component")?;
        for (handles, values) in asked.sets.iter() {
            own.set_reals(handles, values)?;
        }
        let mut room = |count: usize| {
            reals.clear();
            reals.resize(count, 0.0);
        };
        Ok(match question {
            Question::Open { .. } | Question::Free | Question::Nothing => Answer::Done,
            Question::Setup(experiment) => {
                self.time = experiment.start;
                own.setup(&experiment)?;
                Answer::Done
            }
            Question::EnterInitialization => {
                own.enter_initialization()?;
                Answer::Done
            }
            Question::ExitInitialization => {
                own.exit_initialization()?;
                Answer::Moved(Progress::Done, own.next_jump(self.time), None)
            }
            Question::WordsOfDiscard => Answer::Words(own.words_of_discard()),
            Question::GetReals(handles) => {
                room(handles.len());
                own.get_reals(&handles, &mut reals)?;
                Answer::Reals(reals)
            }
            Question::Set(handle, value) => {
                own.set(handle, &value)?;
                Answer::Done
            }
            Question::Get(handle, kind) => Answer::Value(own.get(handle, kind)?),
            Question::Step {
                t,
                h,
                is_revocable,
                outputs,
            } => {
                self.time = t + h;
                let progress = match is_revocable {
                    true => own.step_revocably(t, h)?,
                    false => own.step(t, h)?,
                };
                let is_read = progress == Progress::Done && !outputs.is_empty();
                room(outputs.len());
                let is_read = is_read && own.get_reals(&outputs, &mut reals).is_ok();
                Answer::Moved(
                    progress,
                    own.next_jump(f64::NEG_INFINITY),
                    is_read.then_some(reals),
                )
            }
            Question::Terminate => {
                own.terminate()?;
                Answer::Done
            }
            Question::Renew => Answer::Renewed(own.renew()?),
            Question::Linearize(step) => Answer::Linear(own.linearize(step)?.into()),
            Question::Save(place) => {
                own.save(place)?;
                Answer::Done
            }
            Question::Restore(place) => {
                own.restore(place)?;
                Answer::Moved(Progress::Done, own.next_jump(f64::NEG_INFINITY), None)
            }
            Question::Serialize => Answer::Bytes(own.serialize()?),
            Question::Deserialize(bytes) => {
                own.deserialize(&bytes)?;
                Answer::Moved(Progress::Done, own.next_jump(f64::NEG_INFINITY), None)
            }
            Question::SetInputDerivatives(handles, slopes) => {
                own.set_input_derivatives(&handles, &slopes)?;
                Answer::Done
            }
            Question::GetOutputDerivatives(handles) => {
                room(handles.len());
                own.get_output_derivatives(&handles, &mut reals)?;
                Answer::Reals(reals)
            }
            Question::DirectionalDerivative {
                outputs,
                inputs,
                seed,
            } => {
                room(outputs.len());
                own.directional_derivative(&outputs, &inputs, &seed, &mut reals)?;
                Answer::Reals(reals)
            }
        })
    }
}

/// Reads a path written by [`bytes_of`].
#[cfg(unix)]
fn path_of(bytes: &[u8]) -> PathBuf {
    use std::os::unix::ffi::OsStrExt;
    std::ffi::OsStr::from_bytes(bytes).into()
}

/// The bytes of a path.
#[cfg(unix)]
pub fn bytes_of(path: &Path) -> &[u8] {
    use std::os::unix::ffi::OsStrExt;
    path.as_os_str().as_bytes()
}

#[cfg(not(unix))]
fn path_of(bytes: &[u8]) -> PathBuf {
    String::from_utf8_lossy(bytes).into_owned().into()
}

/// The bytes of a path.
#[cfg(not(unix))]
pub fn bytes_of(path: &Path) -> &[u8] {
    path.to_str().unwrap_or_default().as_bytes()
}
