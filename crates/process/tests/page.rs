//! A page, seen by the process that watches. This process is watched by itself.

use pilotage_process::{Page, Place, attach};

/// A file of an FMU may have any name, and its code may write any: no control character reaches a terminal.
#[test]
fn names_have_no_control_characters() {
    let page = Page::create().unwrap();
    attach(page.path()).unwrap();
    let place = Place::new("a\u{1b}]0;title\u{7}\n.fmu");
    let going = place.call(7, || page.going());
    assert_eq!(going.len(), 1);
    assert_eq!(going[0].name, "a\u{fffd}]0;title\u{fffd}\u{fffd}.fmu");
    assert_eq!(going[0].call, 7);
    assert!(page.going().is_empty());
}
