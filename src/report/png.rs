//! Rasterises drawings with resvg.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Pixels per inch in SVG.
const SVG_PIXELS: f32 = 96.0;

/// Why a drawing cannot be rasterised.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// No font is installed for text.
    #[error("no font is installed, so there are no pixels of text")]
    NoFont,
    /// The drawing is too large or invalid.
    #[error("the drawing cannot be made into {0} pixels")]
    Drawing(String),
}

/// Rasterises an SVG document as PNG with the given pixels per inch.
///
/// # Errors
/// If no font is installed, or the size of the picture is invalid.
pub fn to_png(svg: &str, pixels: f32) -> Result<Vec<u8>, PngError> {
    let mut options = Options::default();
    let fonts = options.fontdb_mut();
    fonts.load_system_fonts();
    let families = || {
        fonts
            .faces()
            .filter_map(|face| Some(face.families.first()?.0.clone()))
    };
    // Fallback if none of the drawing's fonts is installed: any sans-serif font, otherwise any font.
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
