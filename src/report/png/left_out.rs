//! Where the feature `png` is left out.

/// Why no drawing is rasterised.
#[derive(Debug, thiserror::Error)]
#[error("this pilotage is built without the feature `png`")]
pub struct PngError;

/// Rasterises nothing.
///
/// # Errors
/// Always.
pub fn to_png(_svg: &str, _pixels: f32) -> Result<Vec<u8>, PngError> {
    Err(PngError)
}
