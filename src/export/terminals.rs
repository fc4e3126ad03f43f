//! terminalsAndIcons.xml of FMI 3.0 (section 2.4.9): the icon, and a terminal with all inputs and outputs.

use pilotage_text::printable::markup;

/// Folder of the file and the icon.
pub(super) const FOLDER: &str = "terminalsAndIcons";

/// The text of the file, with the names of all inputs and outputs. The terminal is a bus: its members are matched by name.
pub(super) fn file<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let member = |name: &str| {
        let name = markup(name);
        format!(
            "      <TerminalMemberVariable variableName=\"{name}\" memberName=\"{name}\" variableKind=\"signal\"/>\n"
        )
    };
    let members: String = names.map(member).collect();
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
