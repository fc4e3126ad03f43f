//! Drawings as pixels, by resvg.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Pixels in an inch that SVG means.
const SVG_PIXELS: f32 = 96.0;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// Text cannot be drawn.
    #[error("no font is installed, so there are no pixels of text")]
    NoFont,
    /// Too large, or no drawing.
    #[error("the drawing cannot be made into {0} pixels")]
    Drawing(String),
}

/// An SVG document as PNG with that many pixels in an inch.
///
/// # Errors
/// Where no font is installed, or the picture has no size that can be had.
pub fn to_png(svg: &str, pixels: f32) -> Result<Vec<u8>, PngError> {
    let mut options = Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_system_fonts();
    let families = || {
        fonts
            .faces()
            .filter_map(|face| Some(face.families.first()?.0.clone()))
    };
    // Where none of the drawing's fonts is installed, any without serifs, or any.
    let family = families()
        .find(|family| family.contains("Sans"))
        .or_else(|| families().next());
    fonts.set_sans_serif_family(family.ok_or(PngError::NoFont)?);
    let broken = |what: String| PngError::Drawing(what);
    let tree = Tree::from_str(svg, &options).map_err(|error| broken(error.to_string()))?;
    let scale = pixels / SVG_PIXELS;
    let [width, height] =
        [tree.size().width(), tree.size().height()].map(|side| (side * scale).ceil() as u32);
    let mut picture =
        Pixmap::new(width, height).ok_or_else(|| broken(format!("{width} by {height}")))?;
    resvg::render(
        &tree,
        Transform::from_scale(scale, scale),
        &mut picture.as_mut(),
    );
    picture
        .encode_png()
        .map_err(|error| broken(error.to_string()))
}
