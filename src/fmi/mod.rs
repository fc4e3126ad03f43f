//! FMI 2.0: anybody's FMU, read, checked, loaded and called.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`description`] | modelDescription.xml: typed model, reader, writer, validator |

pub mod description;
