//! Getting and setting variables.

use super::{CallError, Instance, c_string, call};
use crate::Function;
use crate::binding::owned_result;
use crate::description::FmiVersion;
use pilotage_abi::fmi2::{Boolean, FALSE, TRUE};
use pilotage_abi::{fmi2, fmi3};
use std::ffi::{CString, c_char};
use std::ptr;

/// A number type of FMU variables: `f64` (`fmi2Real`, `fmi3Float64`), `i32` (`fmi2Integer`, `fmi3Int32`), and those of
/// FMI 3.0 only: `f32`, `i8`, `u8`, `i16`, `u16`, `u32`, `i64`, `u64`.
pub trait Number: Copy + Default + sealed::Sealed {
    /// Gets variables. The elements of an array (FMI 3.0) are consecutive.
    ///
    /// # Errors
    /// See [`CallError`].
    ///
    /// # Panics
    /// If the number of values is not that of the variables.
    fn get(i: &mut Instance, references: &[u32], values: &mut [Self]) -> Result<(), CallError>;

    /// Sets variables, in the same layout.
    ///
    /// # Errors
    /// See [`CallError`].
    ///
    /// # Panics
    /// If the number of values is not that of the variables.
    fn set(i: &mut Instance, references: &[u32], values: &[Self]) -> Result<(), CallError>;
}

mod sealed {
    pub trait Sealed {}
}

macro_rules! number {
    ($($type:ty: $(fmi2 $Get2:ident.$get2:ident, $Set2:ident.$set2:ident,)?
        fmi3 $Get3:ident.$get3:ident, $Set3:ident.$set3:ident;)*) => {$(
        impl sealed::Sealed for $type {}

        impl Number for $type {
            #[inline(always)]
            fn get(i: &mut Instance, r: &[u32], v: &mut [Self]) -> Result<(), CallError> {
                i.check_lengths(r, v.len());
                let n = v.len();
                let functions = (None$(.or(Some(fmi2::Function::$Get2)))?, fmi3::Function::$Get3);
                // SAFETY: the instance is alive; both arrays have the stated lengths.
                i.guarded(v, functions, |i, v| unsafe {
                    call!(i, $(fmi2 $Get2.$get2(r.as_ptr(), r.len(), v),)?
                        fmi3 $Get3.$get3(r.as_ptr(), r.len(), v, n))
                })
            }

            #[inline(always)]
            fn set(i: &mut Instance, r: &[u32], v: &[Self]) -> Result<(), CallError> {
                i.check_lengths(r, v.len());
                // SAFETY: the instance is alive; both arrays have the stated lengths.
                unsafe {
                    call!(i, $(fmi2 $Set2.$set2(r.as_ptr(), r.len(), v.as_ptr()),)?
                        fmi3 $Set3.$set3(r.as_ptr(), r.len(), v.as_ptr(), v.len()))
                }
            }
        }
    )*};
}

number! {
    f64: fmi2 GetReal.get_real, SetReal.set_real,
        fmi3 GetFloat64.get_float64, SetFloat64.set_float64;
    f32: fmi3 GetFloat32.get_float32, SetFloat32.set_float32;
    i8: fmi3 GetInt8.get_int8, SetInt8.set_int8;
    u8: fmi3 GetUInt8.get_uint8, SetUInt8.set_uint8;
    i16: fmi3 GetInt16.get_int16, SetInt16.set_int16;
    u16: fmi3 GetUInt16.get_uint16, SetUInt16.set_uint16;
    i32: fmi2 GetInteger.get_integer, SetInteger.set_integer,
        fmi3 GetInt32.get_int32, SetInt32.set_int32;
    u32: fmi3 GetUInt32.get_uint32, SetUInt32.set_uint32;
    i64: fmi3 GetInt64.get_int64, SetInt64.set_int64;
    u64: fmi3 GetUInt64.get_uint64, SetUInt64.set_uint64;
}

/// Number of guard bytes after a buffer for an FMU, which detect writes beyond its end.
const GUARD: usize = 128;
/// Value of the guard bytes.
const BYTE: u8 = 0xa5;

impl Instance {
    /// Lets the FMU write numbers into a buffer, and checks that it has not written beyond its end.
    #[inline]
    pub(super) fn guarded<T: Number>(
        &mut self,
        values: &mut [T],
        functions: (Option<fmi2::Function>, fmi3::Function),
        call: impl FnOnce(&mut Self, *mut T) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        let size = size_of_val(values);
        let mut room = std::mem::take(&mut self.room);
        room.clear();
        room.resize((size + GUARD).div_ceil(8), u64::from_ne_bytes([BYTE; 8]));
        let begin = room.as_mut_ptr().cast::<u8>();
        // SAFETY: the buffer has `size` bytes and does not overlap the values.
        unsafe { begin.copy_from_nonoverlapping(values.as_ptr().cast(), size) };
        let done = call(self, begin.cast());
        // SAFETY: as above; any bytes are a valid number.
        unsafe { begin.copy_to_nonoverlapping(values.as_mut_ptr().cast(), size) };
        // SAFETY: `GUARD` more bytes follow.
        let guard = unsafe { std::slice::from_raw_parts(begin.add(size), GUARD) };
        let is_whole = guard.iter().fold(true, |is, &byte| is & (byte == BYTE));
        self.room = room;
        match is_whole {
            true => done,
            false => Err(self.beyond(functions, values.len())),
        }
    }

    #[cold]
    fn beyond(
        &self,
        (of2, of3): (Option<fmi2::Function>, fmi3::Function),
        values: usize,
    ) -> CallError {
        let function = match (self.version(), of2) {
            (FmiVersion::V2, Some(of2)) => Function::Fmi2(of2),
            _ => Function::Fmi3(of3),
        };
        let what = format!("more than the {values} values that it was asked for");
        CallError::Absurd { function, what }
    }

    /// An FMU reads or writes as many values as its variables have: in FMI 2.0 the number of values is not passed to it, and
    /// in FMI 3.0 few compare that number with the sizes of their variables.
    #[inline]
    pub(super) fn check_lengths(&self, references: &[u32], values: usize) {
        match self.facts.arrays.is_empty() {
            true => assert_eq!(references.len(), values, "value references and values"),
            false => self.check_sizes(references, values),
        }
    }

    /// The same with arrays among the variables. Of those whose size is a structural parameter any number is taken.
    fn check_sizes(&self, references: &[u32], values: usize) {
        let sizes = references.iter().map(|own| self.facts.arrays.get(own));
        let (mut least, mut is_exact) = (0_usize, true);
        for size in sizes {
            match size {
                None => least += 1,
                Some(Some(size)) => least = least.saturating_add(*size),
                Some(None) => is_exact = false,
            }
        }
        match is_exact {
            true => assert_eq!(least, values, "values of the variables and values"),
            false => assert!(
                least <= values,
                "{least} values of the variables and more, and {values} values"
            ),
        }
    }

    /// Gets numbers; see [`Number`].
    pub fn get<T: Number>(
        &mut self,
        references: &[u32],
        values: &mut [T],
    ) -> Result<(), CallError> {
        T::get(self, references, values)
    }

    /// Sets numbers; see [`Number`].
    pub fn set<T: Number>(&mut self, references: &[u32], values: &[T]) -> Result<(), CallError> {
        T::set(self, references, values)
    }

    /// `fmi2SetReal`, `fmi3SetFloat64`.
    ///
    /// # Panics
    /// If the number of values is not that of the variables, with all elements of arrays, here and in the calls below.
    #[inline]
    pub fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        f64::set(self, references, values)
    }

    /// `fmi2GetReal`, `fmi3GetFloat64`.
    #[inline]
    pub fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        f64::get(self, references, values)
    }

    /// `fmi2SetInteger`, `fmi3SetInt32`, of one variable.
    pub fn set_integer(&mut self, reference: u32, value: i32) -> Result<(), CallError> {
        i32::set(self, &[reference], &[value])
    }

    /// `fmi2GetInteger`, `fmi3GetInt32`, of one variable.
    pub fn get_integer(&mut self, reference: u32) -> Result<i32, CallError> {
        let mut value = [0];
        i32::get(self, &[reference], &mut value).map(|()| value[0])
    }

    /// `fmi2SetBoolean`, `fmi3SetBoolean`.
    pub fn set_booleans(&mut self, references: &[u32], values: &[bool]) -> Result<(), CallError> {
        self.check_lengths(references, values.len());
        let as2 = |&value: &bool| if value { TRUE } else { FALSE };
        let values2: Vec<Boolean> = values.iter().map(as2).collect();
        let (r, n) = (references.as_ptr(), references.len());
        // SAFETY: the instance is alive; all arrays have the stated lengths, here and below.
        unsafe {
            call!(self, fmi2 SetBoolean.set_boolean(r, n, values2.as_ptr()),
                        fmi3 SetBoolean.set_boolean(r, n, values.as_ptr(), values.len()))
        }
    }

    /// `fmi2GetBoolean`, `fmi3GetBoolean`.
    pub fn get_booleans(
        &mut self,
        references: &[u32],
        values: &mut [bool],
    ) -> Result<(), CallError> {
        self.check_lengths(references, values.len());
        let (r, n) = (references.as_ptr(), references.len());
        let mut values2: Vec<Boolean> = vec![FALSE; values.len()];
        // A Rust `bool` must be 0 or 1; an FMU may write other bytes.
        let mut bytes = vec![0u8; values.len()];
        // SAFETY: as above; a C `bool` is a byte.
        unsafe {
            call!(self, fmi2 GetBoolean.get_boolean(r, n, values2.as_mut_ptr()),
                        fmi3 GetBoolean.get_boolean(r, n, bytes.as_mut_ptr().cast(), bytes.len()))?;
        }
        for (value, (two, byte)) in values.iter_mut().zip(values2.iter().zip(&bytes)) {
            *value = *two != FALSE || *byte != 0;
        }
        Ok(())
    }

    /// `fmi2SetBoolean`, `fmi3SetBoolean`, of one variable.
    pub fn set_boolean(&mut self, reference: u32, value: bool) -> Result<(), CallError> {
        self.check_lengths(&[reference], 1);
        let value2 = if value { TRUE } else { FALSE };
        let r = &raw const reference;
        // SAFETY: as above, with one element each; nothing is allocated.
        unsafe {
            call!(self, fmi2 SetBoolean.set_boolean(r, 1, &raw const value2),
                        fmi3 SetBoolean.set_boolean(r, 1, &raw const value, 1))
        }
    }

    /// `fmi2GetBoolean`, `fmi3GetBoolean`, of one variable.
    pub fn get_boolean(&mut self, reference: u32) -> Result<bool, CallError> {
        self.check_lengths(&[reference], 1);
        let (mut value2, mut byte) = (FALSE, 0u8);
        let r = &raw const reference;
        // SAFETY: as above, with one element each; nothing is allocated.
        unsafe {
            call!(self, fmi2 GetBoolean.get_boolean(r, 1, &raw mut value2),
                        fmi3 GetBoolean.get_boolean(r, 1, (&raw mut byte).cast(), 1))?;
        }
        Ok(value2 != FALSE || byte != 0)
    }

    /// `fmi2SetString`, `fmi3SetString`.
    pub fn set_strings(&mut self, references: &[u32], values: &[&str]) -> Result<(), CallError> {
        self.check_lengths(references, values.len());
        let texts = values.iter().map(|value| c_string(value));
        let texts: Vec<CString> = texts.collect::<Result<_, _>>()?;
        let pointers: Vec<*const c_char> = texts.iter().map(|text| text.as_ptr()).collect();
        let (r, n) = (references.as_ptr(), references.len());
        let (p, m) = (pointers.as_ptr(), pointers.len());
        // SAFETY: as above, and the strings live until the call returns.
        unsafe {
            call!(self, fmi2 SetString.set_string(r, n, p), fmi3 SetString.set_string(r, n, p, m))
        }
    }

    /// `fmi2GetString`, `fmi3GetString`; `count` values in total.
    pub fn get_strings(
        &mut self,
        references: &[u32],
        count: usize,
    ) -> Result<Vec<String>, CallError> {
        self.check_lengths(references, count);
        let mut pointers: Vec<*const c_char> = vec![ptr::null(); count];
        let (r, n) = (references.as_ptr(), references.len());
        let p = pointers.as_mut_ptr();
        // SAFETY: as above; after success the FMU's pointers are NULL or strings that are valid until the next call.
        unsafe {
            call!(self, fmi2 GetString.get_string(r, n, p), fmi3 GetString.get_string(r, n, p, count))?;
            let function = match self.version() {
                FmiVersion::V2 => "fmi2GetString",
                FmiVersion::V3 => "fmi3GetString",
            };
            let texts = pointers.iter().map(|&text| owned_result(text, function));
            Ok(texts.map(Option::unwrap_or_default).collect())
        }
    }

    /// `fmi2SetString`, `fmi3SetString`, of one variable.
    pub fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError> {
        self.set_strings(&[reference], &[value])
    }

    /// `fmi2GetString`, `fmi3GetString`, of one variable.
    pub fn get_string(&mut self, reference: u32) -> Result<String, CallError> {
        let texts = self.get_strings(&[reference], 1)?;
        Ok(texts.into_iter().next().unwrap_or_default())
    }

    /// `fmi3SetBinary`.
    pub fn set_binaries(&mut self, references: &[u32], values: &[&[u8]]) -> Result<(), CallError> {
        self.check_lengths(references, values.len());
        let sizes: Vec<usize> = values.iter().map(|value| value.len()).collect();
        let pointers: Vec<*const u8> = values.iter().map(|value| value.as_ptr()).collect();
        let (r, n) = (references.as_ptr(), references.len());
        let (s, p) = (sizes.as_ptr(), pointers.as_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 SetBinary.set_binary(r, n, s, p, values.len())) }
    }

    /// `fmi3GetBinary`; `count` values in total.
    pub fn get_binaries(
        &mut self,
        references: &[u32],
        count: usize,
    ) -> Result<Vec<Vec<u8>>, CallError> {
        self.check_lengths(references, count);
        let mut sizes = vec![0usize; count];
        let mut pointers: Vec<*const u8> = vec![ptr::null(); count];
        let (r, n) = (references.as_ptr(), references.len());
        let (s, p) = (sizes.as_mut_ptr(), pointers.as_mut_ptr());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 GetBinary.get_binary(r, n, s, p, count))? };
        let copy = |(&bytes, &size): (&*const u8, &usize)| match bytes.is_null() {
            true => Vec::new(),
            // SAFETY: after success there are `size` bytes, which are valid until the next call.
            false => unsafe { std::slice::from_raw_parts(bytes, size) }.to_vec(),
        };
        Ok(pointers.iter().zip(&sizes).map(copy).collect())
    }

    /// `fmi3SetClock`: sets which clocks tick.
    ///
    /// # Panics
    /// If the numbers of values and references differ, here and below.
    pub fn set_clocks(&mut self, references: &[u32], values: &[bool]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len());
        let (r, n) = (references.as_ptr(), references.len());
        // SAFETY: as above.
        unsafe { call!(self, fmi3 SetClock.set_clock(r, n, values.as_ptr())) }
    }

    /// `fmi3GetClock`: which clocks tick. Reading an output clock resets it.
    pub fn get_clocks(&mut self, references: &[u32], values: &mut [bool]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len());
        let (r, n) = (references.as_ptr(), references.len());
        let mut bytes = vec![0u8; n];
        // SAFETY: as above; a C `bool` is a byte.
        unsafe { call!(self, fmi3 GetClock.get_clock(r, n, bytes.as_mut_ptr().cast()))? };
        for (value, byte) in values.iter_mut().zip(&bytes) {
            *value = *byte != 0;
        }
        Ok(())
    }
}
