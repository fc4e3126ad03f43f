//! What is written reads back as the same value, whole; and what is read never panics.

use pilotage::fmi::description::*;
use proptest::collection::vec;
use proptest::option::of;
use proptest::prelude::*;
use proptest::sample::select;

/// Text with everything that needs care in XML.
fn text() -> impl Strategy<Value = String> {
    let c = prop_oneof![
        4 => proptest::char::range('a', 'z'),
        2 => select(&['&', '<', '>', '"', '\'', ' ', '\t', '\n', '\r', ';', '%', ']'][..]),
        1 => select(&['ä', '中', '\u{7f}', '\u{85}', '\u{2028}', '🚁'][..]),
    ];
    vec(c, 0..12).prop_map(|chars| chars.into_iter().collect())
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>().prop_filter("NaN equals nothing", |v| !v.is_nan()),
        -1e3..1e3,
        select(
            &[
                0.0,
                -0.0,
                f64::INFINITY,
                f64::NEG_INFINITY,
                5e-324,
                f64::MAX,
                1e16,
                1e-5
            ][..]
        ),
    ]
}

fn real_attributes() -> impl Strategy<Value = RealAttributes> {
    let texts = (of(text()), of(text()), of(text()));
    let limits = (of(number()), of(number()), of(number()));
    (texts, limits, of(any::<bool>()), of(any::<bool>())).prop_map(
        |((quantity, unit, display_unit), (min, max, nominal), relative_quantity, unbounded)| {
            RealAttributes {
                quantity,
                unit,
                display_unit,
                relative_quantity,
                min,
                max,
                nominal,
                unbounded,
            }
        },
    )
}

fn integer_attributes() -> impl Strategy<Value = IntegerAttributes> {
    (of(text()), of(any::<i32>()), of(any::<i32>()))
        .prop_map(|(quantity, min, max)| IntegerAttributes { quantity, min, max })
}

fn kind() -> impl Strategy<Value = VariableKind> {
    let real = (
        of(text()),
        real_attributes(),
        of(number()),
        of(any::<u32>()),
        any::<bool>(),
    )
        .prop_map(|(declared_type, attributes, start, derivative, reinit)| {
            VariableKind::Real(RealVariable {
                declared_type,
                attributes,
                start,
                derivative,
                reinit,
            })
        });
    let integer = (of(text()), integer_attributes(), of(any::<i32>())).prop_map(
        |(declared_type, attributes, start)| VariableKind::Integer {
            declared_type,
            attributes,
            start,
        },
    );
    let boolean =
        (of(text()), of(any::<bool>())).prop_map(|(declared_type, start)| VariableKind::Boolean {
            declared_type,
            start,
        });
    let string = (of(text()), of(text())).prop_map(|(declared_type, start)| VariableKind::String {
        declared_type,
        start,
    });
    let enumeration = (text(), integer_attributes(), of(any::<i32>())).prop_map(
        |(declared_type, attributes, start)| VariableKind::Enumeration {
            declared_type,
            attributes,
            start,
        },
    );
    prop_oneof![real, integer, boolean, string, enumeration]
}

fn tool() -> impl Strategy<Value = Tool> {
    let content = select(
        &[
            "",
            " ",
            "<a b=\"1\">x &amp; y</a>",
            "\n  <x/>\n  <!-- c --><y:z xmlns:y=\"u\"/>",
        ][..],
    );
    (text(), content).prop_map(|(name, content)| Tool {
        name,
        content: content.to_owned(),
    })
}

fn variable() -> impl Strategy<Value = ScalarVariable> {
    let roles = (
        select(Causality::ALL),
        select(Variability::ALL),
        of(select(Initial::ALL)),
    );
    let rest = (of(any::<bool>()), kind(), vec(tool(), 0..3));
    (text(), any::<u32>(), of(text()), roles, rest).prop_map(
        |(name, value_reference, description, roles, rest)| ScalarVariable {
            name,
            value_reference,
            description,
            causality: roles.0,
            variability: roles.1,
            initial: roles.2,
            can_handle_multiple_set_per_time_instant: rest.0,
            kind: rest.1,
            annotations: rest.2,
        },
    )
}

fn unit() -> impl Strategy<Value = Unit> {
    let base = (any::<[i32; 8]>(), number(), number()).prop_map(|(e, factor, offset)| BaseUnit {
        kg: e[0],
        m: e[1],
        s: e[2],
        ampere: e[3],
        kelvin: e[4],
        mol: e[5],
        cd: e[6],
        rad: e[7],
        factor,
        offset,
    });
    let display = (text(), number(), number()).prop_map(|(name, factor, offset)| DisplayUnit {
        name,
        factor,
        offset,
    });
    (text(), of(base), vec(display, 0..3)).prop_map(|(name, base, display_units)| Unit {
        name,
        base,
        display_units,
    })
}

fn simple_type() -> impl Strategy<Value = SimpleType> {
    let item =
        (text(), any::<i32>(), of(text())).prop_map(|(name, value, description)| EnumerationItem {
            name,
            value,
            description,
        });
    let kind = prop_oneof![
        real_attributes().prop_map(TypeKind::Real),
        integer_attributes().prop_map(TypeKind::Integer),
        Just(TypeKind::Boolean),
        Just(TypeKind::String),
        (of(text()), vec(item, 0..3))
            .prop_map(|(quantity, items)| TypeKind::Enumeration { quantity, items }),
    ];
    (text(), of(text()), kind).prop_map(|(name, description, kind)| SimpleType {
        name,
        description,
        kind,
    })
}

fn unknown() -> impl Strategy<Value = Unknown> {
    let kinds = of(vec(select(DependencyKind::ALL), 0..4));
    (any::<u32>(), of(vec(any::<u32>(), 0..4)), kinds).prop_map(
        |(index, dependencies, dependencies_kind)| Unknown {
            index,
            dependencies,
            dependencies_kind,
        },
    )
}

fn structure() -> impl Strategy<Value = ModelStructure> {
    let list = || vec(unknown(), 0..3);
    (list(), list(), list()).prop_map(|(outputs, derivatives, initial_unknowns)| ModelStructure {
        outputs,
        derivatives,
        initial_unknowns,
    })
}

fn co_simulation() -> impl Strategy<Value = CoSimulation> {
    (text(), any::<[bool; 9]>(), any::<u32>(), vec(text(), 0..3)).prop_map(
        |(model_identifier, flags, max_output_derivative_order, source_files)| CoSimulation {
            model_identifier,
            needs_execution_tool: flags[0],
            can_handle_variable_communication_step_size: flags[1],
            can_interpolate_inputs: flags[2],
            max_output_derivative_order,
            can_run_asynchronously: flags[3],
            can_be_instantiated_only_once_per_process: flags[4],
            can_not_use_memory_management_functions: flags[5],
            can_get_and_set_fmu_state: flags[6],
            can_serialize_fmu_state: flags[7],
            provides_directional_derivative: flags[8],
            source_files,
        },
    )
}

fn model_exchange() -> impl Strategy<Value = ModelExchange> {
    (text(), any::<[bool; 7]>(), vec(text(), 0..3)).prop_map(
        |(model_identifier, flags, source_files)| ModelExchange {
            model_identifier,
            needs_execution_tool: flags[0],
            completed_integrator_step_not_needed: flags[1],
            can_be_instantiated_only_once_per_process: flags[2],
            can_not_use_memory_management_functions: flags[3],
            can_get_and_set_fmu_state: flags[4],
            can_serialize_fmu_state: flags[5],
            provides_directional_derivative: flags[6],
            source_files,
        },
    )
}

fn description() -> impl Strategy<Value = ModelDescription> {
    let names = (text(), text(), proptest::array::uniform8(of(text())));
    let interfaces = (of(model_exchange()), of(co_simulation()), of(any::<u32>()));
    let categories = vec((text(), of(text())), 0..3);
    let experiment = of((of(number()), of(number()), of(number()), of(number())));
    let lists = (vec(unit(), 0..4), vec(simple_type(), 0..4), categories);
    let naming = select(NamingConvention::ALL);
    let rest = (
        experiment,
        vec(tool(), 0..3),
        vec(variable(), 1..6),
        structure(),
    );
    (names, interfaces, naming, lists, rest).prop_map(
        |((model_name, guid, texts), interfaces, naming_convention, lists, rest)| {
            let [
                description,
                author,
                version,
                copyright,
                license,
                tool,
                date,
                _,
            ] = texts;
            ModelDescription {
                model_name,
                guid,
                description,
                author,
                version,
                copyright,
                license,
                generation_tool: tool,
                generation_date_and_time: date,
                naming_convention,
                number_of_event_indicators: interfaces.2,
                model_exchange: interfaces.0,
                co_simulation: interfaces.1,
                units: lists.0,
                types: lists.1,
                log_categories: lists
                    .2
                    .into_iter()
                    .map(|(name, description)| LogCategory { name, description })
                    .collect(),
                default_experiment: rest.0.map(|e| DefaultExperiment {
                    start_time: e.0,
                    stop_time: e.1,
                    tolerance: e.2,
                    step_size: e.3,
                }),
                vendor_annotations: rest.1,
                variables: rest.2,
                structure: rest.3,
            }
        },
    )
}

/// The same cases on every run.
fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config(256))]

    #[test]
    fn written_descriptions_read_back_whole(written in description()) {
        let xml = written.to_xml();
        let reading = read(xml.as_bytes()).map_err(|e| TestCaseError::fail(format!("{e}\n{xml}")))?;
        prop_assert_eq!(&reading.findings, &vec![], "{}", xml);
        // Whatever the values are, the rules can be checked.
        validate(&reading);
        prop_assert_eq!(reading.description, written, "{}", xml);
    }

    #[test]
    fn damaged_descriptions_never_panic(written in description(), cut in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut bytes = written.to_xml().into_bytes();
        let at = cut.index(bytes.len());
        bytes[at] = byte;
        if let Ok(reading) = read(&bytes) {
            validate(&reading);
        }
        bytes.truncate(at);
        let is_cut = at < written.to_xml().len() - "\n".len();
        prop_assert_eq!(read(&bytes).is_err(), is_cut);
    }
}

#[test]
fn encodings() {
    let xml = "<?xml version=\"1.0\" encoding=\"ENC\"?><fmiModelDescription fmiVersion=\"2.0\" modelName=\"Größe\" guid=\"g\"/>";
    let utf8 = xml.replace("ENC", "UTF-8");
    let latin: Vec<u8> = xml
        .replace("ENC", "ISO-8859-1")
        .chars()
        .map(|c| u8::try_from(u32::from(c)).unwrap())
        .collect();
    let utf16 = |mark: [u8; 2], bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
        let body = xml.replace("ENC", "UTF-16");
        let units = body.encode_utf16().flat_map(bytes);
        mark.into_iter().chain(units).collect()
    };
    let marked: Vec<u8> = [0xef, 0xbb, 0xbf].into_iter().chain(utf8.bytes()).collect();
    for bytes in [
        utf8.into_bytes(),
        latin,
        marked,
        utf16([0xff, 0xfe], u16::to_le_bytes),
        utf16([0xfe, 0xff], u16::to_be_bytes),
    ] {
        assert_eq!(read(&bytes).unwrap().description.model_name, "Größe");
    }
}

#[test]
fn encodings_that_cannot_be_read() {
    for (bytes, message) in [
        (
            &b"<?xml version='1.0'?>\n<a b='\xf6'/>"[..],
            "modelDescription.xml, line 2: byte 0xf6 is not UTF-8; save the file as UTF-8",
        ),
        (
            b"\xff\xfe<",
            "modelDescription.xml has a UTF-16 byte order mark but is not UTF-16",
        ),
        (
            b"<?xml version='1.0' encoding='EBCDIC'?><a/>",
            "modelDescription.xml is encoded in ebcdic; UTF-8, UTF-16 and ISO-8859-1 can be read",
        ),
    ] {
        assert_eq!(read(bytes).unwrap_err().to_string(), message);
    }
}
