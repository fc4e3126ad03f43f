//! `pilotage fly`: a person flies a vehicle on a browser page and is recorded.

mod jobs;

use self::jobs::{Flown, Jobs};
use super::number::number;
use super::recognise::{self, FileKind};
use super::{Failure, Outcome, interrupt, made, system, terminal};
use crate::file;
use crate::flights::trials::sha256;
use crate::report;
use crate::series::flown;
use clap::builder::NonEmptyStringValueParser;
use pilotage_fly::craft::{Craft, Maker, Names};
use pilotage_fly::flightgear::{self, Runway, Version};
use pilotage_fly::hand::Hand;
use pilotage_fly::joystick::{self, Reading};
use pilotage_fly::protocol::Protocol;
use pilotage_fly::record;
use pilotage_fly::server::{self, Server};
use pilotage_fly::session::{Board, Command, Place, Session};
use pilotage_text::counted;
use std::ffi::OsString;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, SystemTime};

const EXAMPLES: &str = "\
Examples:
  # The quadcopter of the paper: training, targets of 10 m and 20 m, then tracking of sines.
  pilotage fly

  # Your own vehicle: a model file, or an FMU in a separate process.
  pilotage fly my_aircraft.toml
  pilotage fly my_aircraft.fmu --isolate --input elevator --measure altitude

  # Another protocol and folder, with a joystick that is read directly.
  pilotage fly --protocol steps.toml -o day1 --stick /dev/input/event5

The page opens in the browser; it is served to this computer only, and needs no network. Valid flights are
written to FOLDER/CODE-TASK-N.csv, which `pilotage fit` reads; training, invalid flights and the logs of all
steps go to subfolders. docs/fly.md describes tasks, protocol files, recorded data and delays.
Exit codes: 0 done, 2 bad use or input.";

/// Arguments of `pilotage fly`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Vehicle: a built-in model, a model file, a vehicle file or an FMU.
    #[arg(value_name = "VEHICLE", default_value = "quadcopter")]
    vehicle: OsString,
    /// Protocol file with the tasks [default: targets of 10 and 20, tracking and disturbances].
    #[arg(long, value_name = "FILE")]
    protocol: Option<PathBuf>,
    /// Folder for the flights.
    #[arg(short, long, value_name = "FOLDER", default_value = "flights")]
    output: PathBuf,
    /// Inputs that the stick drives [default: `stick` and `stick2`, or the first].
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = NonEmptyStringValueParser::new())]
    input: Vec<String>,
    /// Outputs that are positions [default: `position` and `position2`, `z`, or the first].
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = NonEmptyStringValueParser::new())]
    measure: Vec<String>,
    /// Run an FMU in a separate process.
    #[arg(long)]
    isolate: bool,
    /// Joystick to read directly instead of the browser's devices: an event device of Linux, or js0.
    #[arg(long, value_name = "DEVICE")]
    stick: Option<PathBuf>,
    /// Numbers of the joystick's axes, from 0; a minus sign reverses an axis: 0,-1 [default: 0, for two axes -1,0:
    /// forward, right].
    #[arg(
        long,
        value_name = "NUMBER",
        value_delimiter = ',',
        requires = "stick",
        allow_hyphen_values = true
    )]
    stick_axes: Vec<String>,
    /// Also show the vehicle in FlightGear; the position of the marker is sent to the next port (docs/fly.md).
    #[arg(long, value_name = "HOST:PORT")]
    flightgear: Option<String>,
    /// Start position and heading in FlightGear [default: runway 28R of San Francisco].
    #[arg(long, value_name = "LAT,LON,HEADING,ELEVATION", requires = "flightgear", value_delimiter = ',', value_parser = number, allow_hyphen_values = true)]
    runway: Vec<f64>,
    /// Version of FlightGear's packets: 24, or 25 after FlightGear 2020.3.
    #[arg(long, value_name = "24|25", requires = "flightgear", default_value_t = 24, value_parser = clap::value_parser!(u8).range(24..=25))]
    flightgear_version: u8,
    /// Port of the page [default: a free one].
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Serve the page at this address, also to other computers; requires --insecure.
    #[arg(long, value_name = "ADDRESS")]
    bind: Option<IpAddr>,
    /// Accept that anyone on the network can read the address with its token, fly, and read the records.
    #[arg(long)]
    insecure: bool,
    /// Print the address and open no browser.
    #[arg(long)]
    no_browser: bool,
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let is_open = args.bind.is_some_and(|address| !address.is_loopback());
    if let (Some(address), true, false) = (args.bind, is_open, args.insecure) {
        let message = format!(
            "--bind {address} serves the page to other computers: nothing is encrypted, and anyone who has its address may fly and \
             read what is recorded"
        );
        return Err(Failure::new(message).hint("if that is meant, add --insecure"));
    }
    let craft = args.craft()?;
    let protocol = match &args.protocol {
        Some(file) => Protocol::read(file, craft.shape())?,
        None => Protocol::usual(craft.shape()),
    };
    let folder = std::path::absolute(&args.output)
        .map_err(|error| Failure::cannot_write(&args.output, &error))?;
    std::fs::create_dir_all(&folder)
        .map_err(|error| Failure::cannot_write(&args.output, &error))?;
    let unfinished =
        record::unfinished(&folder).map_err(|error| Failure::cannot_write(&args.output, &error))?;
    let unfinished_note = |part: PathBuf| {
        let name = part.strip_prefix(&folder).unwrap_or(&part).display();
        format!("{name} is a flight that did not come to its end; it does not count")
    };
    let mut notes: Vec<String> = unfinished.into_iter().map(unfinished_note).collect();
    let made = folder.join("made");
    let flown = Flown {
        vehicle: args.vehicle_from_anywhere(),
        hash: flown::vehicle(&[format!("vehicle: {}", craft.origin)])
            .unwrap_or_default()
            .to_owned(),
        forward: craft.forward(),
    };
    let jobs = Jobs::new(flown, folder.clone(), made.clone());
    let others = jobs.of_others();
    notes.extend((others > 0).then(|| {
        format!(
            "{} in {} of another vehicle: what is identified here leaves them out",
            counted(others, "flight"),
            args.output.display()
        )
    }));
    notes.iter().for_each(|note| terminal::note(note));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| Failure::new(format!("cannot serve a page: {error}")))?;
    interrupt::listen("ending the session")?;
    let hand = Arc::new(Hand::new(craft.axes()));
    args.listen_to_stick(&hand, craft.axes())?;
    let picture = args.picture()?;
    let (sender, commands) = channel();
    let place = Place {
        header: vec![
            (
                "recorded by",
                format!("pilotage fly {}", env!("CARGO_PKG_VERSION")),
            ),
            (
                "system",
                format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            ),
            ("date", made::made().date),
        ],
        folder: folder.clone(),
        notes,
    };
    let (session, board) = Session::new(
        craft,
        protocol,
        place,
        hand.clone(),
        commands,
        Box::new(jobs),
    );
    let served = runtime.block_on(async {
        let address = SocketAddr::new(
            args.bind.unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST)),
            args.port,
        );
        let listener = tokio::net::TcpListener::bind(address).await?;
        let server = Server {
            listener,
            token: server::token()?,
            is_open,
            made,
            policy: report::policy(),
        };
        let address = server.address()?;
        args.print_address(&address);
        let session = std::thread::Builder::new().spawn(move || session.run())?;
        if let Some(picture) = picture {
            tokio::spawn(show(picture, board.clone()));
        }
        let quit = sender.clone();
        let until = async {
            while !interrupt::is_asked() {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        };
        let serving = server.serve(board, hand, sender);
        tokio::select! {
            ended = serving => ended?,
            () = until => {}
        }
        // A current run is stopped and recorded as one that does not count; the pages are notified of the end.
        let _ = quit.send(Command::Quit);
        let _ = tokio::task::spawn_blocking(move || session.join()).await;
        tokio::time::sleep(Duration::from_millis(100)).await;
        Ok::<(), std::io::Error>(())
    });
    served.map_err(|error| {
        let failure = Failure::new(format!("cannot serve the page: {error}"));
        match error.kind() {
            std::io::ErrorKind::AddrInUse => failure.hint("leave --port out, or name another one"),
            _ => failure,
        }
    })?;
    Ok(Outcome::Done)
}

impl Args {
    fn craft(&self) -> Result<Craft, Failure> {
        let path = PathBuf::from(&self.vehicle);
        if recognise::is_problem(&path) {
            let message = format!("{} is a problem file; expected a vehicle", path.display());
            let hint =
                "name the model of its vehicle, or what a fit of it wrote: INSTANCE-fitted.toml";
            return Err(Failure::new(message).hint(hint));
        }
        recognise::expect(
            [&path],
            &[
                FileKind::Fmu,
                FileKind::Archive,
                FileKind::Vehicle,
                FileKind::Model,
            ],
            "a vehicle: a model file, a vehicle file or an FMU",
        )?;
        let (name, is_isolated) = (self.vehicle.clone(), self.isolate);
        if is_isolated && !recognise::is_fmu(&path) {
            return Err(
                Failure::new("--isolate is for FMUs, and the vehicle is none").hint("leave it out"),
            );
        }
        // Errors in the file are reported here, as by every command.
        drop(system::open_one(&name, is_isolated)?);
        let make: Maker = Box::new(move || {
            system::open_one(&name, is_isolated)
                .map_err(|failure| failure.message().to_owned().into())
        });
        let names = Names {
            inputs: self.input.clone(),
            outputs: self.measure.clone(),
        };
        let shown = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Craft::new(&shown, origin(&path), &names, make).map_err(|error| {
            Failure::from(error).hint(
                "--input NAME and --measure NAME say what the hand moves, and what the position is",
            )
        })
    }

    /// The vehicle as an argument for a command in another folder.
    fn vehicle_from_anywhere(&self) -> OsString {
        let path = Path::new(&self.vehicle);
        match path.exists() {
            true => std::path::absolute(path).map_or_else(|_| self.vehicle.clone(), OsString::from),
            false => self.vehicle.clone(),
        }
    }

    fn listen_to_stick(&self, hand: &Arc<Hand>, axes: usize) -> Result<(), Failure> {
        let Some(path) = &self.stick else {
            return Ok(());
        };
        let usual = if axes == 1 { &["0"][..] } else { &["-1", "0"] };
        let words: Vec<&str> = match self.stick_axes.as_slice() {
            [] => usual.to_vec(),
            words => words.iter().map(String::as_str).collect(),
        };
        let number = |word: &&str| {
            let number = word.strip_prefix('-').unwrap_or(word).parse::<u8>();
            number.map(usize::from).map_err(|_| {
                let message = format!("--stick-axes: `{word}` is no number of an axis");
                Failure::new(message)
                    .hint("from 0 to 255, with a minus for one that is turned round: 0,-1")
            })
        };
        let numbers: Vec<usize> = words.iter().map(number).collect::<Result<_, _>>()?;
        if numbers.len() != axes {
            let message = format!(
                "--stick-axes {}: the vehicle wants {axes} of them",
                words.join(",")
            );
            return Err(Failure::new(message).hint("numbers from 0, with commas between them"));
        }
        let inverted = words.iter().map(|word| word.starts_with('-')).collect();
        let listened = joystick::listen(path, Reading::new(numbers, inverted), hand.clone());
        let (_, note) = listened.map_err(|error| {
            let message = format!("cannot read the joystick {}: {error}", path.display());
            Failure::new(message).hint(match error.kind() {
                std::io::ErrorKind::PermissionDenied => {
                    "members of the group `input` may: sudo usermod -aG input $USER, and log in again"
                }
                _ => {
                    "ls -l /dev/input/by-id/*-event-joystick shows what is there; the page reads a gamepad without this option"
                }
            })
        })?;
        note.iter().for_each(|note| terminal::note(note));
        Ok(())
    }

    /// The sender of FlightGear packets, if requested.
    fn picture(&self) -> Result<Option<flightgear::Sender>, Failure> {
        let Some(destination) = &self.flightgear else {
            return Ok(None);
        };
        let wrong = |why: String| {
            Failure::new(format!("--flightgear {destination}: {why}"))
                .hint("such as --flightgear localhost:5500")
        };
        if destination.ends_with(":0") {
            return Err(wrong("port 0 is none".to_owned()));
        }
        if destination.ends_with(":65535") {
            let why = "the marker's place goes to the port after this one, and there is none";
            return Err(wrong(why.to_owned()));
        }
        let mut found = destination
            .to_socket_addrs()
            .map_err(|error| wrong(error.to_string()))?;
        let address = found
            .next()
            .ok_or_else(|| wrong("no such host".to_owned()))?;
        let runway = match self.runway.as_slice() {
            numbers if numbers.iter().any(|number| !number.is_finite()) => {
                return Err(Failure::new(
                    "--runway: numbers alone, such as 37.6136,-122.3571,298,4",
                ));
            }
            &[latitude, longitude, ..] if latitude.abs() > 90.0 || longitude.abs() > 180.0 => {
                return Err(Failure::new(format!(
                    "--runway: latitude {latitude} and longitude {longitude} are no place; -90 to 90 and -180 to 180"
                )));
            }
            &[latitude, longitude, heading, elevation] => Runway {
                latitude,
                longitude,
                heading,
                elevation,
            },
            [] => Runway::default(),
            _ => {
                return Err(Failure::new(
                    "--runway takes four numbers: latitude, longitude and heading [deg], elevation [m]",
                ));
            }
        };
        let version = if self.flightgear_version == 24 {
            Version::V24
        } else {
            Version::V25
        };
        flightgear::Sender::new(address, runway, version)
            .map(Some)
            .map_err(|error| wrong(error.to_string()))
    }

    fn print_address(&self, address: &str) {
        let opened = !self.no_browser && open(address);
        // The unspecified address cannot be opened from another computer.
        let every = self.bind.filter(IpAddr::is_unspecified);
        let address = match every.and_then(|_| own_address()) {
            Some(own) => &address.replacen(&every.map(host).unwrap_or_default(), &host(own), 1),
            None => address,
        };
        let words = if opened {
            "the page opens in the browser:"
        } else {
            "open in a browser:"
        };
        if self.bind.is_some_and(|address| !address.is_loopback()) {
            terminal::note(
                "other computers may open the page: anyone who has this address may fly and read the recordings, and nothing is encrypted",
            );
        }
        terminal::eprint(&format!(
            "{words} {address}\nflights go to {}; Ctrl-C ends\n",
            terminal::shown(&self.output)
        ));
    }
}

/// The address as the host of a URL.
fn host(address: IpAddr) -> String {
    match address {
        IpAddr::V4(own) => own.to_string(),
        IpAddr::V6(own) => format!("[{own}]"),
    }
}

/// This computer's network address: that of the interface for outgoing packets. No packet is sent.
fn own_address() -> Option<IpAddr> {
    // A documentation address (RFC 5737).
    const ELSEWHERE: (Ipv4Addr, u16) = (Ipv4Addr::new(192, 0, 2, 1), 9);
    let socket = std::net::UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    socket.connect(ELSEWHERE).ok()?;
    let own = socket.local_addr().ok()?.ip();
    (!own.is_unspecified()).then_some(own)
}

/// Sends the vehicle's position to FlightGear until the end.
async fn show(mut picture: flightgear::Sender, board: Arc<Board>) {
    let states = board.listen().states;
    let mut ticks = tokio::time::interval(Duration::from_secs_f64(1.0 / flightgear::RATE));
    loop {
        ticks.tick().await;
        let state = states.borrow().clone();
        let now = SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)
            .unwrap_or_default()
            .as_secs() as u32;
        // FlightGear may not be running yet.
        let _ = picture.send(&state, now);
    }
}

/// Opens the page in a browser, if the system provides a command for it.
fn open(address: &str) -> bool {
    use std::process::{Command, Stdio};
    let (program, before): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    let command = command
        .args(before)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.spawn().is_ok()
}

/// Origin of the vehicle model for the record.
fn origin(path: &Path) -> String {
    match file::bytes(path) {
        Ok(bytes) => format!("{}, sha256 {}", path.display(), sha256(&bytes)),
        Err(_) => {
            let name = path.to_string_lossy();
            let text = crate::models::library::find(&name).map_or("", |own| own.text);
            format!("built in, sha256 {}", sha256(text.as_bytes()))
        }
    }
}
