//! FMI 2.0: anybody's FMU, read, checked, loaded and called.
//!
//! | module | what it does |
//! | --- | --- |
//! | [`description`] | modelDescription.xml: typed model, reader, writer, validator |
//! | [`archive`] | the zip file: checked, then unpacked |
//! | [`platform`] | which folder holds this machine's binary |
//! | [`binary`] | a look into the binary before it is loaded |

pub mod archive;
pub mod binary;
pub mod description;
pub mod platform;
