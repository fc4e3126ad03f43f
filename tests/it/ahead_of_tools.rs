//! Runs first, since tests run by their names: what the tests of [`crate::tools`] wait for is made while others run.

use crate::tools::python;

#[test]
fn python_has_the_packages_of_the_tests() {
    assert!(python::interpreter().exists());
}
