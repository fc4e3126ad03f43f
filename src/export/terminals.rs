//! terminalsAndIcons.xml of FMI 3.0 (section 2.4.9): the icon, and a terminal with all inputs and outputs.

use pilotage_sdk::{Interface, Role, Variable};
use pilotage_text::printable::markup;

/// Folder of the file and the icon.
pub(super) const FOLDER: &str = "terminalsAndIcons";

/// The text of the file. The terminal is a bus: its members are matched by name.
pub(super) fn file(interface: &Interface) -> String {
    let member = |name: &str| {
        let name = markup(name);
        format!(
            "      <TerminalMemberVariable variableName=\"{name}\" memberName=\"{name}\" variableKind=\"signal\"/>\n"
        )
    };
    let is_outside = |v: &&Variable| v.role == Role::Input || v.is_output();
    let members: String = (interface.variables.iter())
        .filter(is_outside)
        .map(|v| member(&v.name))
        .collect();
    let icon = "x1=\"-120\" y1=\"-80\" x2=\"120\" y2=\"80\"";
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiTerminalsAndIcons fmiVersion=\"3.0\">\n\
         \x20 <GraphicalRepresentation>\n\
         \x20   <CoordinateSystem {icon} suggestedScalingFactorTo_mm=\"0.1\"/>\n\
         \x20   <Icon {icon}/>\n\
         \x20 </GraphicalRepresentation>\n\
         \x20 <Terminals>\n\
         \x20   <Terminal name=\"signals\" matchingRule=\"bus\" description=\"All inputs and outputs\">\n\
         {members}\
         \x20   </Terminal>\n\
         \x20 </Terminals>\n\
         </fmiTerminalsAndIcons>\n"
    )
}
