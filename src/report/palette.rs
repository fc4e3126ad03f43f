//! Colours for light and dark pages that can be distinguished with colour blindness: those of Okabe & Ito, *Color
//! Universal Design* (2008), some darker or lighter so that thin lines are visible.

use std::fmt::Write;

/// Number of line colours.
pub const N_COLOURS: usize = 8;

/// Name, colour on white, colour on a dark page.
const COLOURS: [(&str, &str, &str); 13] = [
    ("ink", "#1c2128", "#e4e8ec"),
    ("quiet", "#5c6672", "#9aa5b1"),
    ("data", "#7b8591", "#8b96a3"),
    ("goal", "#3f4852", "#c3cbd3"),
    ("aid", "#9aa3ad", "#69737f"),
    ("line-1", "#0072b2", "#58b0ea"),
    ("line-2", "#d55e00", "#ff8b3d"),
    ("line-3", "#009e73", "#2cc99a"),
    ("line-4", "#b3548a", "#e58fbf"),
    ("line-5", "#b98000", "#f0b429"),
    ("line-6", "#3f51b5", "#93a3f5"),
    ("line-7", "#3a97c9", "#9fd8ff"),
    ("line-8", "#7a5230", "#c99a6f"),
];

/// Name of a line colour by number, counted from 0; colours repeat after [`N_COLOURS`].
pub fn colour(number: usize) -> String {
    format!("line-{}", number % N_COLOURS + 1)
}

/// A colour on white by name; the text colour if the name is unknown.
pub fn on_white(name: &str) -> &'static str {
    let known = COLOURS.iter().find(|(known, ..)| *known == name);
    known.map_or(COLOURS[0].1, |(_, light, _)| light)
}

/// The colour of a value from -1 to 1: from orange through white to blue.
pub fn of_value(value: f64) -> String {
    let end = match value < 0.0 {
        true => [0xd5, 0x5e, 0x00],
        false => [0x00, 0x72, 0xb2],
    };
    let part = value.abs().min(1.0);
    let mixed = end.map(|end| (255.0 + (f64::from(end) - 255.0) * part).round() as u8);
    format!("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2])
}

/// The colours as CSS variables.
pub fn css() -> String {
    let (mut light, mut dark) = (String::new(), String::new());
    for (name, on_white, on_dark) in COLOURS {
        let _ = write!(light, " --{name}: {on_white};");
        let _ = write!(dark, " --{name}: {on_dark};");
    }
    format!(
        ":root {{{light} }}\n@media screen and (prefers-color-scheme: dark) {{ :root {{{dark} }} }}\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance (WCAG 2.1).
    fn luminance(colour: &str) -> f64 {
        let part = |k: usize| {
            let v = f64::from(u8::from_str_radix(&colour[k..k + 2], 16).unwrap()) / 255.0;
            match v <= 0.04045 {
                true => v / 12.92,
                false => ((v + 0.055) / 1.055).powf(2.4),
            }
        };
        0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
    }

    /// WCAG 2.1 requires a contrast of 3:1 for graphics; auxiliary lines may be fainter.
    #[test]
    fn lines_stand_out_from_the_page() {
        for (name, light, dark) in COLOURS.into_iter().filter(|(name, ..)| *name != "aid") {
            let on_white = 1.05 / (luminance(light) + 0.05);
            let on_dark = (luminance(dark) + 0.05) / (luminance("#14181d") + 0.05);
            assert!(
                on_white >= 3.0 && on_dark >= 3.0,
                "{name} {on_white} {on_dark}"
            );
        }
    }

    #[test]
    fn values_go_from_orange_over_white_to_blue() {
        let colours = [-1.0, 0.0, 1.0, 7.0].map(of_value);
        assert_eq!(colours, ["#d55e00", "#ffffff", "#0072b2", "#0072b2"]);
    }
}
