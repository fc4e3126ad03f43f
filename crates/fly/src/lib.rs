//! Real-time flights of a human pilot on a page in the browser, with recording.
//!
//! The [vehicle](craft) is any co-simulation component; it runs in a separate thread at 1 kHz ([`run`]), controlled by
//! the [hand] of the person at the page. A [session] follows a [protocol]: training, then measured runs of its
//! [tasks](task). Each run is [recorded](record) as a flight that `pilotage fit` reads. The [server] provides the page,
//! on this computer only.
//!
//! ```
//! use pilotage_cosim::NativeComponent;
//! use pilotage_fly::craft::{Craft, Names};
//! use pilotage_fly::protocol::Protocol;
//! use pilotage_models::{Model, Quadcopter};
//!
//! let make = || Ok(Box::new(NativeComponent::new(Model::quadcopter(&Quadcopter::default()))) as _);
//! let craft = Craft::new("quadcopter", "built in".into(), &Names::default(), Box::new(make))?;
//! let protocol = Protocol::usual(craft.shape());
//! assert_eq!((craft.axes(), protocol.tasks[0].title.as_str()), (1, "10 m"));
//! # Ok::<(), pilotage_fly::craft::CraftError>(())
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`server`](mod@server) | the page and its socket |
//! | `connections` | connections of the server: few without the token
//! | [`message`](mod@message) | what page and server say to each other |
//! | [`session`](mod@session) | welcome, training, measured runs, results |
//! | [`protocol`](mod@protocol) | tasks and their order |
//! | [`task`](mod@task) | targets and disturbances over time |
//! | [`run`](mod@run) | one run in real time |
//! | [`craft`](mod@craft) | the vehicle |
//! | [`hand`](mod@hand) | the input of the hand, and whether a run with it is valid |
//! | [`joystick`](mod@joystick) | a joystick at the server |
//! | [`beside`](mod@beside) | the identified pilot on a second vehicle |
//! | [`record`](mod@record) | the files of a run |
//! | [`distribution`](mod@distribution) | distributions of times |
//! | [`flightgear`](mod@flightgear) | FlightGear as display |

pub mod beside;
mod connections;
pub mod craft;
pub mod distribution;
pub mod flightgear;
pub mod hand;
pub mod joystick;
pub mod message;
pub mod protocol;
pub mod record;
pub mod run;
pub mod server;
pub mod session;
pub mod task;
