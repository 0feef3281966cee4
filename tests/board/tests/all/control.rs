//! The served bench under command, over TCP, as seen by a program that controls a calibration.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use mimu_board::flash::Change;
use mimu_board::front::Front;
use mimu_board::running::{Board, STORE};
use mimu_board::schematic::Volts;
use mimu_board::serve::{COMMANDS, Pace, Served};
use mimu_board_tests::conversation::Conversation;
use mimu_board_tests::{image, still};
use mimu_core::wire::{Call, Decoder, MAX_FRAME, Message, Request, encode};
use mimu_rig::located::Source;
use mimu_rig::plan::Plan;
use mimu_rig::rig_file::{RigFile, RigTruth};

use super::power::calibration;

/// If no answer comes, the test fails and does not hang.
const PATIENCE: Duration = Duration::from_secs(300);
const G: f64 = 9.793;

fn commanded(carrier: &str) -> Board {
    let text = format!(
        "format = \"mimu-plan/1\"\nsample_rate_hz = 1000.0\ncarrier = \"{carrier}\"\ngravity_mps2 = {G}\n\
         [[step]]\nup = [0, 0, 1]\ndwell_s = 1"
    );
    let plan = Plan::parse(Source::new("plan", text)).unwrap();
    let truth = RigTruth::resolve(&RigFile::default(), 7).unwrap();
    Board::new(&image(), Front::commanded(&plan, &truth, 7).unwrap()).unwrap()
}

/// Serves a board during the test and returns it.
fn serve(mut served: Served, test: impl FnOnce(&mut Client)) -> Served {
    let address = served.listen("127.0.0.1:0", 7).unwrap();
    let done = AtomicBool::new(false);
    /// Ends the serving also if the test panics.
    struct End<'a>(&'a AtomicBool);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                served.step().unwrap();
            }
            served
        });
        {
            let _end = End(&done);
            test(&mut Client::new(address));
        }
        serving.join().unwrap()
    })
}

struct Client {
    address: SocketAddr,
    stream: BufReader<TcpStream>,
}

impl Client {
    fn new(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Self {
            address,
            stream: BufReader::new(stream),
        }
    }

    fn ask(&mut self, line: &str) -> String {
        writeln!(self.stream.get_ref(), "{line}").unwrap();
        let mut answer = String::new();
        self.stream.read_line(&mut answer).unwrap();
        answer.trim_end().to_owned()
    }

    fn tell(&mut self, line: &str) {
        assert_eq!(self.ask(line), "OK", "{line}");
    }

    fn refusal(&mut self, line: &str) -> String {
        let answer = self.ask(line);
        answer.strip_prefix("ERR ").expect(&answer).to_owned()
    }

    fn numbers(&mut self, line: &str) -> Vec<f64> {
        let answer = self.ask(line);
        let number = |word: &str| word.parse().unwrap_or_else(|_| panic!("{answer}"));
        answer.split(' ').map(number).collect()
    }
}

fn open(path: impl AsRef<Path>) -> File {
    File::options().read(true).write(true).open(path).unwrap()
}

#[test]
fn commands_are_answered_while_the_bench_stands_still_because_nobody_reads_the_port() {
    let served = Served::new(commanded("hands"), Pace::Fast, None).unwrap();
    let served = serve(served, |client| {
        assert_eq!(client.ask("*IDN?"), "mimu-bench,hands,7,1");
        assert_eq!(client.ask("POSITION?"), "0 0 1 NaN");
        assert_eq!(client.ask("busy?"), "0");
        client.tell("MOVE 0 -3 0 45\r");
        assert_eq!(client.ask("BUSY?"), "1");
        assert_eq!(client.ask("POSITION?"), "0 -1 0 45");
        assert_eq!(client.ask("TIME?"), "0.000000000");
        client.tell("FIDGET 3");
        client.tell("HOLD ON");
        // The next client, and one that sends everything at once and closes its end.
        let mut other = Client::new(client.address);
        assert_eq!(other.ask("INTERLOCK?"), "1");
        other.tell("INTERLOCK 0");
        assert!(other.refusal("MOVE 0 0 1").contains("interlock"));
        other.tell("INTERLOCK 1");
        let mut third = Client::new(client.address);
        let stream = third.stream.get_ref();
        (&*stream).write_all(b"LINK?\nPOWER?").unwrap();
        stream.shutdown(std::net::Shutdown::Write).unwrap();
        let mut all = String::new();
        third.stream.read_to_string(&mut all).unwrap();
        assert_eq!(all, "1\n1\n");
        for (line, problem) in [
            ("", "empty"),
            ("FLY", "unknown command"),
            (
                "MOVE 1 0",
                "2 arguments; send `MOVE ux uy uz [heading_deg]`",
            ),
            ("MOVE 0 0 0", "no length"),
            ("MOVE 1 nan 0", "not within"),
            ("MOVE 1 x 0", "`x` is not a number"),
            ("MOVE 1 0 0 720", "not within -360 to 360"),
            ("RATE 10", "constant rate"),
            ("CHAMBER 300", "not within -100 to 200"),
            ("FIDGET 1.5", "not a whole number"),
            ("LINK PERHAPS", "send `LINK ON|OFF`"),
        ] {
            let refusal = client.refusal(line);
            assert!(refusal.contains(problem), "{line}: {refusal}");
        }
        let long = "x".repeat(5000);
        assert!(other.refusal(&long).contains("too long"));
        assert_eq!(client.ask("LINK?"), "1", "the others go on");
    });
    assert_eq!(served.traffic().delivered, 0);
}

/// A program that has the port open.
struct Host {
    port: File,
    decoder: Decoder,
}

impl Host {
    fn new(path: String) -> Self {
        Self {
            port: open(path),
            decoder: Decoder::new(),
        }
    }

    fn hello(&mut self, id: u16) {
        let mut frame = [0; MAX_FRAME];
        let request = Request::Hello;
        let length = encode(&Call { id, request }, &mut frame).unwrap();
        self.port.write_all(&frame[..length]).unwrap();
    }

    /// Id of the call that the next greeting answers; 0 means the device sent it without a call.
    fn greeting(&mut self) -> u16 {
        loop {
            let mut byte = [0];
            self.port.read_exact(&mut byte).unwrap();
            let frame = self.decoder.push(byte[0]);
            if let Some(Message::Greeting { id, .. }) = frame.and_then(|f| f.message()) {
                return id;
            }
        }
    }
}

#[test]
fn the_line_is_garbled_and_unplugged_and_the_device_restarted_as_told() {
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("port");
    let mut served = Served::new(commanded("table"), Pace::Fast, None).unwrap();
    served.link(&link).unwrap();
    let path = link.display().to_string();
    let mut served = serve(served, |client| {
        assert_eq!(PathBuf::from(client.ask("PORT?")), link);
        let mut host = Host::new(path.clone());
        assert_eq!(host.greeting(), 0);
        host.hello(1);
        assert_eq!(host.greeting(), 1);
        // One byte of the answer is garbled; the next answer is intact.
        client.tell("BURST 1");
        host.hello(2);
        host.hello(3);
        assert_eq!(host.greeting(), 3);
        // Every byte is garbled, and then none: to the device and from it.
        client.tell("GARBLE 1000000");
        host.hello(4);
        let now = client.numbers("TIME?")[0];
        while client.numbers("TIME?")[0] < now + 0.05 {}
        client.tell("GARBLE 0");
        host.hello(5);
        host.hello(6);
        assert!(host.greeting() > 4);

        client.tell("LINK OFF");
        client.tell("LINK OFF");
        assert!(host.port.write_all(b"lost").is_err());
        assert!(matches!(host.port.read(&mut [0; 100]), Ok(0) | Err(_)));
        assert!(!link.exists());
        client.tell("LINK ON");
        let mut host = Host::new(path.clone());
        host.hello(7);
        assert_eq!(host.greeting(), 7);

        client.tell("RESET");
        let now = client.numbers("TIME?")[0];
        while client.numbers("TIME?")[0] < now + 0.002 {}
        client.tell("POWER OFF");
        assert!(client.refusal("RESET").contains("POWER ON"));
        client.tell("POWER ON");
        while client.numbers("TIME?")[0] < now + 0.006 {}
    });
    let restarts = served.board().restarts().unwrap();
    let causes: Vec<&str> = restarts.iter().map(|r| r.cause.as_str()).collect();
    assert_eq!(causes, ["Pin", "PowerOn"]);
    let traffic = served.traffic();
    assert!(traffic.garbled >= 1, "{traffic:?}");
    assert_eq!((traffic.lost, traffic.unpowered), (0, 0));
}

#[test]
#[ignore = "nightly: seconds of the board"]
fn what_a_cut_leaves_of_a_flash_word_is_in_the_file_at_once_and_stays_when_the_supply_is_back() {
    let mut device = Conversation::new(still(Volts::GROUND));
    device.greeting();
    device.upload(&calibration(1, 1.0));
    device.send(Request::UploadCommit);
    let programs = |device: &mut Conversation| {
        let flying = device.board.in_flight().unwrap();
        let word = |change: &Change| matches!(change, Change::Program(b) if b.contains(&0));
        flying
            .iter()
            .any(|o| o.address >= STORE && word(&o.change) && o.ends_ns > o.begins_ns)
    };
    while !programs(&mut device) {
        device.run_for(5_000);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unit.flash");
    let served = Served::new(device.board, Pace::Fast, Some(&path)).unwrap();
    let mut served = serve(served, |client| {
        client.tell("POWER OFF");
        let kept = fs::read(&path).unwrap();
        assert!(kept.iter().any(|&byte| byte != 0xFF), "nothing is torn");
        client.tell("POWER ON");
    });
    assert_eq!(fs::read(&path).unwrap(), served.board().store().unwrap());
}

#[test]
fn the_page_has_every_command_with_its_arguments() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/bench.md");
    let page = fs::read_to_string(page).unwrap();
    for (name, arguments) in COMMANDS {
        let command = format!("{name} {arguments}").trim_end().replace('|', "\\|");
        assert!(page.contains(&format!("| `{command}` |")), "{command}");
    }
}
