//! What is written reads back as the same value, whole; and what is read never panics.

use pilotage::fmi::description::*;
use pilotage::fmi_check::validate;
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

fn real_attributes(precision: Precision) -> impl Strategy<Value = RealAttributes> {
    let texts = (of(text()), of(text()), of(text()));
    let number = || of(numbers(precision));
    let limits = (number(), number(), number());
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

/// The version that a description under test has; FMI 2.0 has fewer types.
fn is_v3(version: FmiVersion) -> bool {
    version == FmiVersion::V3
}

/// Numbers that a type can hold.
fn numbers(precision: Precision) -> BoxedStrategy<f64> {
    match precision {
        Precision::Double => number().boxed(),
        Precision::Single => any::<f32>()
            .prop_filter("NaN equals nothing", |v| !v.is_nan())
            .prop_map(f64::from)
            .boxed(),
    }
}

fn precision(version: FmiVersion) -> BoxedStrategy<Precision> {
    match version {
        FmiVersion::V2 => Just(Precision::Double).boxed(),
        FmiVersion::V3 => select(Precision::ALL).boxed(),
    }
}

fn integer_type(version: FmiVersion) -> BoxedStrategy<IntegerType> {
    match version {
        FmiVersion::V2 => Just(IntegerType::Int32).boxed(),
        FmiVersion::V3 => select(IntegerType::ALL).boxed(),
    }
}

/// What an enumeration is stored as.
fn enumerated(version: FmiVersion) -> IntegerType {
    match version {
        FmiVersion::V2 => IntegerType::Int32,
        FmiVersion::V3 => IntegerType::Int64,
    }
}

/// Start values: one at most in FMI 2.0.
fn starts<T: std::fmt::Debug + Clone + 'static>(
    version: FmiVersion,
    value: impl Strategy<Value = T> + 'static,
) -> BoxedStrategy<Vec<T>> {
    match version {
        FmiVersion::V2 => vec(value, 0..2).boxed(),
        FmiVersion::V3 => vec(value, 0..4).boxed(),
    }
}

fn integer_attributes(integer: IntegerType) -> impl Strategy<Value = IntegerAttributes> {
    (of(text()), of(integer.range()), of(integer.range()))
        .prop_map(|(quantity, min, max)| IntegerAttributes { quantity, min, max })
}

fn binary_attributes() -> impl Strategy<Value = BinaryAttributes> {
    (of(text()), of(any::<u64>())).prop_map(|(mime_type, max_size)| BinaryAttributes {
        mime_type,
        max_size,
    })
}

fn clock_attributes() -> impl Strategy<Value = ClockAttributes> {
    let float = || any::<f32>().prop_filter("NaN equals nothing", |v| !v.is_nan());
    let flags = (any::<bool>(), any::<bool>(), of(any::<u32>()));
    let counters = (of(any::<u64>()), of(any::<u64>()), any::<u64>());
    let times = (of(float()), float());
    (select(IntervalVariability::ALL), flags, times, counters).prop_map(
        |(interval_variability, flags, times, counters)| ClockAttributes {
            can_be_deactivated: flags.0,
            priority: flags.2,
            interval_variability,
            interval_decimal: times.0,
            shift_decimal: times.1,
            supports_fraction: flags.1,
            resolution: counters.0,
            interval_counter: counters.1,
            shift_counter: counters.2,
        },
    )
}

fn real_kind(version: FmiVersion) -> BoxedStrategy<VariableKind> {
    precision(version)
        .prop_flat_map(move |precision| {
            let attributes = real_attributes(precision);
            let rest = (of(1..=VARIABLES), any::<bool>());
            (
                of(text()),
                attributes,
                starts(version, numbers(precision)),
                rest,
            )
                .prop_map(
                    move |(declared_type, attributes, start, (derivative, reinit))| {
                        VariableKind::Real(RealVariable {
                            precision,
                            declared_type,
                            attributes,
                            start,
                            derivative,
                            reinit,
                        })
                    },
                )
        })
        .boxed()
}

fn integer_kind(version: FmiVersion) -> BoxedStrategy<VariableKind> {
    integer_type(version)
        .prop_flat_map(move |integer| {
            let start = starts(version, integer.range());
            (of(text()), integer_attributes(integer), start).prop_map(
                move |(declared_type, attributes, start)| VariableKind::Integer {
                    integer,
                    declared_type,
                    attributes,
                    start,
                },
            )
        })
        .boxed()
}

fn kind(version: FmiVersion) -> BoxedStrategy<VariableKind> {
    let boolean =
        (of(text()), starts(version, any::<bool>())).prop_map(|(declared_type, start)| {
            VariableKind::Boolean {
                declared_type,
                start,
            }
        });
    let string = (of(text()), starts(version, text())).prop_map(|(declared_type, start)| {
        VariableKind::String {
            declared_type,
            start,
        }
    });
    let integer = enumerated(version);
    let start = starts(version, integer.range());
    let enumeration = (text(), integer_attributes(integer), start).prop_map(
        |(declared_type, attributes, start)| VariableKind::Enumeration {
            declared_type,
            attributes,
            start,
        },
    );
    let both = prop_oneof![
        real_kind(version),
        integer_kind(version),
        boolean,
        string,
        enumeration
    ];
    let start = vec(vec(any::<u8>(), 0..4), 0..3);
    let binary =
        (of(text()), binary_attributes(), start).prop_map(|(declared_type, attributes, start)| {
            VariableKind::Binary {
                declared_type,
                attributes,
                start,
            }
        });
    let clock = (of(text()), clock_attributes()).prop_map(|(declared_type, attributes)| {
        VariableKind::Clock {
            declared_type,
            attributes,
        }
    });
    match is_v3(version) {
        false => both.boxed(),
        true => prop_oneof![5 => both, 1 => binary, 1 => clock].boxed(),
    }
}

/// Annotations, each tool's once.
fn tools() -> impl Strategy<Value = Vec<Tool>> {
    vec(tool(), 0..3).prop_map(|mut tools| {
        tools.dedup_by(|a, b| a.name == b.name);
        tools
    })
}

fn tool() -> impl Strategy<Value = Tool> {
    let content = select(
        &[
            "",
            " ",
            "<a b=\"1\">x &amp; y</a>",
            "\n  <!-- c --><y:z xmlns:y=\"u\"><x/> x</y:z>\n",
        ][..],
    );
    (text(), content).prop_map(|(name, content)| Tool {
        name,
        content: content.to_owned(),
    })
}

fn alias(is_real: bool) -> impl Strategy<Value = Alias> {
    (text(), of(text()), of(text())).prop_map(move |(name, description, display_unit)| Alias {
        name,
        description,
        display_unit: display_unit.filter(|_| is_real),
    })
}

/// What FMI 3.0 adds to every variable.
fn additions(kind: &VariableKind) -> impl Strategy<Value = Additions> + use<> {
    let dimension = prop_oneof![
        any::<u64>().prop_map(Dimension::Fixed),
        (1..=VARIABLES).prop_map(Dimension::Variable),
    ];
    let is_clock = matches!(kind, VariableKind::Clock { .. });
    let clocks = vec(1..=VARIABLES, 0..3);
    let aliases = vec(alias(kind.base_type().is_real()), 0..3);
    let dimensions = vec(dimension, 0..3);
    let rest = (any::<bool>(), of(1..=VARIABLES), dimensions);
    (clocks, aliases, rest).prop_map(move |(clocks, aliases, rest)| match is_clock {
        // A clock is a scalar and has no previous value.
        true => (clocks, aliases, (false, None, Vec::new())),
        false => (clocks, aliases, rest),
    })
}

type Additions = (Vec<u32>, Vec<Alias>, (bool, Option<u32>, Vec<Dimension>));

fn variable(version: FmiVersion) -> BoxedStrategy<ScalarVariable> {
    let roles = (
        select(Causality::all(version)),
        select(Variability::ALL),
        of(select(Initial::ALL)),
    );
    let kind = kind(version).prop_flat_map(|kind| (Just(kind.clone()), additions(&kind)));
    let rest = (of(any::<bool>()), kind, tools());
    (text(), any::<u32>(), of(text()), roles, rest)
        .prop_map(
            move |(
                name,
                value_reference,
                description,
                roles,
                (multiple, (kind, added), annotations),
            )| {
                let mut variable = ScalarVariable {
                    description,
                    initial: roles.2,
                    can_handle_multiple_set_per_time_instant: multiple,
                    annotations,
                    ..ScalarVariable::new(name, value_reference, roles.0, roles.1, kind)
                };
                if is_v3(version) {
                    if let VariableKind::Clock { .. } = variable.kind {
                        variable.initial = None;
                    }
                    (variable.clocks, variable.aliases) = (added.0, added.1);
                    let (update, previous, dimensions) = added.2;
                    variable.intermediate_update = update;
                    (variable.previous, variable.dimensions) = (previous, dimensions);
                }
                variable
            },
        )
        .boxed()
}

fn unit(version: FmiVersion) -> BoxedStrategy<Unit> {
    let base =
        (any::<[i32; 8]>(), number(), number()).prop_map(|(exponents, factor, offset)| BaseUnit {
            exponents,
            factor,
            offset,
        });
    let display = (text(), number(), number(), any::<bool>()).prop_map(
        move |(name, factor, offset, inverse)| DisplayUnit {
            name,
            factor,
            offset,
            inverse: inverse && is_v3(version),
        },
    );
    (text(), of(base), vec(display, 0..3))
        .prop_map(|(name, base, display_units)| Unit {
            name,
            base,
            display_units,
        })
        .boxed()
}

fn type_kind(version: FmiVersion) -> BoxedStrategy<TypeKind> {
    let real = precision(version).prop_flat_map(|precision| {
        real_attributes(precision).prop_map(move |attributes| TypeKind::Real {
            precision,
            attributes,
        })
    });
    let integer = integer_type(version).prop_flat_map(|integer| {
        integer_attributes(integer).prop_map(move |attributes| TypeKind::Integer {
            integer,
            attributes,
        })
    });
    let values = enumerated(version);
    let item = (text(), values.range(), of(text())).prop_map(|(name, value, description)| {
        EnumerationItem {
            name,
            value: i64::try_from(value).unwrap(),
            description,
        }
    });
    let enumeration =
        (integer_attributes(values), vec(item, 1..4)).prop_map(move |(mut attributes, items)| {
            if !is_v3(version) {
                (attributes.min, attributes.max) = (None, None);
            }
            TypeKind::Enumeration { attributes, items }
        });
    let both = prop_oneof![
        real,
        integer,
        Just(TypeKind::Boolean),
        Just(TypeKind::String),
        enumeration
    ];
    match is_v3(version) {
        false => both.boxed(),
        true => prop_oneof![
            5 => both,
            1 => binary_attributes().prop_map(TypeKind::Binary),
            1 => clock_attributes().prop_map(TypeKind::Clock),
        ]
        .boxed(),
    }
}

fn simple_type(version: FmiVersion) -> BoxedStrategy<SimpleType> {
    (text(), of(text()), type_kind(version))
        .prop_map(|(name, description, kind)| SimpleType {
            name,
            description,
            kind,
        })
        .boxed()
}

fn unknown(version: FmiVersion) -> impl Strategy<Value = Unknown> {
    // FMI 2.0 writes indices as they are, wrong ones too.
    let index = move || match version {
        FmiVersion::V2 => any::<u32>().boxed(),
        FmiVersion::V3 => (1..=VARIABLES).boxed(),
    };
    let kinds = of(vec(select(DependencyKind::ALL), 0..4));
    (index(), of(vec(index(), 0..4)), kinds).prop_map(|(index, dependencies, dependencies_kind)| {
        Unknown {
            index,
            dependencies,
            dependencies_kind,
        }
    })
}

fn structure(version: FmiVersion) -> BoxedStrategy<ModelStructure> {
    let list = || vec(unknown(version), 0..3);
    (list(), list(), list(), list(), list())
        .prop_map(move |lists| {
            let mut structure = ModelStructure {
                outputs: lists.0,
                derivatives: lists.1,
                initial_unknowns: lists.2,
                ..ModelStructure::default()
            };
            if is_v3(version) {
                structure.clocked_states = lists.3;
                structure.event_indicators = lists.4;
            }
            structure
        })
        .boxed()
}

fn co_simulation(version: FmiVersion) -> BoxedStrategy<CoSimulation> {
    let rest = (vec(text(), 0..3), of(number()), any::<i32>());
    (text(), any::<[bool; 16]>(), any::<u32>(), rest)
        .prop_map(
            move |(model_identifier, flags, max_output_derivative_order, rest)| {
                let both = CoSimulation {
                    model_identifier,
                    needs_execution_tool: flags[0],
                    can_handle_variable_communication_step_size: flags[1],
                    max_output_derivative_order,
                    can_be_instantiated_only_once_per_process: flags[2],
                    can_get_and_set_fmu_state: flags[3],
                    can_serialize_fmu_state: flags[4],
                    provides_directional_derivative: flags[5],
                    ..CoSimulation::default()
                };
                match version {
                    FmiVersion::V2 => CoSimulation {
                        can_interpolate_inputs: flags[6],
                        can_run_asynchronously: flags[7],
                        can_not_use_memory_management_functions: flags[8],
                        source_files: rest.0,
                        ..both
                    },
                    FmiVersion::V3 => CoSimulation {
                        provides_adjoint_derivatives: flags[9],
                        provides_per_element_dependencies: flags[10],
                        provides_intermediate_update: flags[11],
                        might_return_early_from_do_step: flags[12],
                        can_return_early_after_intermediate_update: flags[13],
                        has_event_mode: flags[14],
                        provides_evaluate_discrete_states: flags[15],
                        fixed_internal_step_size: rest.1,
                        recommended_intermediate_input_smoothness: rest.2,
                        ..both
                    },
                }
            },
        )
        .boxed()
}

fn model_exchange(version: FmiVersion) -> BoxedStrategy<ModelExchange> {
    (text(), any::<[bool; 10]>(), vec(text(), 0..3))
        .prop_map(move |(model_identifier, flags, source_files)| {
            let both = ModelExchange {
                model_identifier,
                needs_execution_tool: flags[0],
                completed_integrator_step_not_needed: flags[1],
                can_be_instantiated_only_once_per_process: flags[2],
                can_get_and_set_fmu_state: flags[3],
                can_serialize_fmu_state: flags[4],
                provides_directional_derivative: flags[5],
                ..ModelExchange::default()
            };
            match version {
                FmiVersion::V2 => ModelExchange {
                    can_not_use_memory_management_functions: flags[6],
                    source_files,
                    ..both
                },
                FmiVersion::V3 => ModelExchange {
                    provides_adjoint_derivatives: flags[7],
                    provides_per_element_dependencies: flags[8],
                    provides_evaluate_discrete_states: flags[9],
                    ..both
                },
            }
        })
        .boxed()
}

fn scheduled_execution() -> impl Strategy<Value = ScheduledExecution> {
    (text(), any::<[bool; 7]>()).prop_map(|(model_identifier, flags)| ScheduledExecution {
        model_identifier,
        needs_execution_tool: flags[0],
        can_be_instantiated_only_once_per_process: flags[1],
        can_get_and_set_fmu_state: flags[2],
        can_serialize_fmu_state: flags[3],
        provides_directional_derivative: flags[4],
        provides_adjoint_derivatives: flags[5],
        provides_per_element_dependencies: flags[6],
    })
}

/// How many variables a description under test has.
const VARIABLES: u32 = 4;

fn description() -> impl Strategy<Value = ModelDescription> {
    select(&[FmiVersion::V2, FmiVersion::V3][..]).prop_flat_map(description_of)
}

fn description_of(version: FmiVersion) -> BoxedStrategy<ModelDescription> {
    let names = (text(), text(), proptest::array::uniform8(of(text())));
    let release = select(&[None, Some("3.0.1"), Some("3.1-beta.2")][..]);
    let interfaces = (
        of(model_exchange(version)),
        of(co_simulation(version)),
        of(scheduled_execution()),
        of(any::<u32>()),
        release,
    );
    let categories = vec((text(), of(text())), 0..3);
    let experiment = of((of(number()), of(number()), of(number()), of(number())));
    let lists = (
        vec(unit(version), 0..4),
        vec(simple_type(version), 0..4),
        categories,
    );
    let naming = select(NamingConvention::ALL);
    let rest = (
        experiment,
        tools(),
        vec(variable(version), VARIABLES as usize),
        structure(version),
    );
    (names, interfaces, naming, lists, rest)
        .prop_map(
            move |((model_name, guid, texts), interfaces, naming_convention, lists, mut rest)| {
                if is_v3(version) {
                    // There they are what tells variables apart.
                    (100..)
                        .zip(&mut rest.2)
                        .for_each(|(reference, v)| v.value_reference = reference);
                }
                let release = interfaces.4.filter(|_| is_v3(version));
                let [
                    description,
                    author,
                    model_version,
                    copyright,
                    license,
                    tool,
                    date,
                    _,
                ] = texts;
                ModelDescription {
                    fmi_version: version,
                    fmi_release: release.map(str::to_owned),
                    model_name,
                    guid,
                    description,
                    author,
                    version: model_version,
                    copyright,
                    license,
                    generation_tool: tool,
                    generation_date_and_time: date,
                    naming_convention,
                    number_of_event_indicators: interfaces.3.filter(|_| !is_v3(version)),
                    model_exchange: interfaces.0,
                    co_simulation: interfaces.1,
                    scheduled_execution: interfaces.2.filter(|_| is_v3(version)),
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
        .boxed()
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
    #![proptest_config(config(512))]

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
