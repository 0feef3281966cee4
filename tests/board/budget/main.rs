//! The cost of the firmware, counted on the emulated board: `cargo run -p mimu-board-tests --bin budget [-- --check]`.
//!
//! With `--check` a figure above `budget.toml` is an error. Both images must be built before; `make budget` does this.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

use mimu_board::front::Front;
use mimu_board::image::Image;
use mimu_board::inertial::Sensed;
use mimu_board::running::Board;
use mimu_board::schematic::Volts;
use mimu_board_tests::conversation::{Answer, Conversation};
use mimu_board_tests::{MS, STARTED, built, digital_image, image, still};
use mimu_core::effects::DeviceEffect;
use mimu_core::wire::{EFFECTS, Request};

/// Cycles of the core in a millisecond.
const CYCLES_PER_MS: f64 = 400e3;

/// Cycles per instruction, lower and upper bound. The core issues two instructions at a time. A load from RAM takes about ten cycles, because the RAM
/// is behind two buses at half the core's clock and is not cached (estimated; no board has been measured). With the instruction cache on, fetching
/// adds little. The emulator counts instructions, not cycles.
const CYCLES: [(&str, f64); 2] = [("load_lower_percent", 0.5), ("load_upper_percent", 10.0)];

/// Explanation of the load figures.
const LOAD: &str = "load: counted instructions, of 400 MHz, at two a cycle (lower) and at ten cycles each (upper). \
                    Instructions are counted; cycles are estimated and not measured.";

/// Limit for the effects without their own limit.
const EACH: &str = "effect_instructions";

/// Effects that are evaluated at every sample, and a term, in the order of `tests/counted`.
fn effects() -> impl Iterator<Item = &'static str> {
    let runs = |id: &&str| {
        let of = |count: usize| DeviceEffect::<f32>::named(id, &[1e-4; 9][..count], None);
        of(9).or(of(3)).is_ok_and(|effect| !effect.is_slow())
    };
    EFFECTS.iter().copied().filter(runs).chain(["term"])
}

fn main() -> ExitCode {
    let check = std::env::args()
        .skip(1)
        .any(|argument| argument == "--check");
    match figures().and_then(|figures| report(&figures, check)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("budget: {problem}");
            ExitCode::FAILURE
        }
    }
}

fn figures() -> Result<BTreeMap<String, f64>, String> {
    let mut figures = BTreeMap::new();
    let marked = counted()?;
    let mut marked = marked.into_iter().map(|instructions| instructions as f64);
    let mut next = || {
        marked
            .next()
            .ok_or("tests/counted runs less than is expected")
    };
    figures.insert("compensation_instructions".into(), next()?);
    // For one filter of a bank of three.
    figures.insert("kalman_update_instructions".into(), next()? / 3.0);
    let none = next()?;
    let mut shared = 0.0_f64;
    for effect in effects() {
        let (one, two) = (next()?, next()?);
        let each = two - one;
        figures.insert(format!("{effect}_instructions"), each);
        shared = shared.max(one - each);
    }
    figures.insert("no_effect_instructions".into(), none);
    figures.insert("effects_of_a_triad_instructions".into(), shared - none);
    // Not the firmware's: xu's comparison (docs/papers/xu.md).
    figures.insert("forward_model_kept_inverse_instructions".into(), next()?);
    figures.insert("forward_model_inverse_instructions".into(), next()?);
    if next().is_ok() {
        return Err("tests/counted runs more than is expected".into());
    }
    let each = per_ms(Conversation::new(still(Volts::GROUND)))?;
    figures.insert("sample_instructions".into(), each);
    for (name, cycles) in CYCLES {
        figures.insert(name.into(), 100.0 * each * cycles / CYCLES_PER_MS);
    }
    let sizes = image().sizes();
    figures.insert("flash_bytes".into(), sizes.flash as f64);
    figures.insert("ram_bytes".into(), sizes.ram as f64);
    let feed = Box::new(|_| Sensed {
        rate_dps: [1.0; 3],
        force_g: [0.5; 3],
        die_c: 30.0,
    });
    let digital = Board::digital(&digital_image(), feed, 1.0, [0; 12])?;
    let each = per_ms(Conversation::new(digital))?;
    figures.insert("matek_sample_instructions".into(), each);
    let sizes = digital_image().sizes();
    figures.insert("matek_flash_bytes".into(), sizes.flash as f64);
    figures.insert("matek_ram_bytes".into(), sizes.ram as f64);
    Ok(figures)
}

/// Instructions in a millisecond while raw readings are streamed.
fn per_ms(mut device: Conversation) -> Result<f64, String> {
    device.greeting();
    device.run_for(STARTED);
    let stream = device.ask(Request::Stream {
        raw: true,
        compensated: false,
    });
    if stream != Answer::Done {
        return Err(format!("the stream of raw readings: {stream:?}"));
    }
    // A digital sensor's first sample comes half a second after its start.
    device.run_for(1000 * MS);
    let began = device.board.state();
    let ms = 1000;
    let ended = device.board.run_for(ms * MS)?;
    Ok((ended.instructions - began.instructions) as f64 / ms as f64)
}

/// Instructions between each pair of marks, minus those of the empty pair.
fn counted() -> Result<Vec<u64>, String> {
    let image = Image::read(&built("mimu-counted"))?;
    let (from, to) = (image.find("counted_from")?, image.find("counted_to")?);
    let mut board = Board::new(&image, Front::Still(Volts::GROUND))?;
    board.watch(from)?;
    board.watch(to)?;
    board.run_for(100 * MS)?;
    let arrivals = board.arrivals()?;
    if arrivals.is_empty()
        || arrivals
            .chunks(2)
            .any(|pair| pair.len() < 2 || pair[0].address != from || pair[1].address != to)
    {
        return Err("the marks of tests/counted did not come in pairs".into());
    }
    let spans: Vec<u64> = arrivals
        .chunks(2)
        .map(|pair| pair[1].instructions - pair[0].instructions)
        .collect();
    Ok(spans[1..].iter().map(|span| span - spans[0]).collect())
}

fn report(figures: &BTreeMap<String, f64>, check: bool) -> Result<(), String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("budget.toml");
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let most: BTreeMap<String, toml::Value> =
        toml::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))?;
    let number = |value: &toml::Value| {
        value
            .as_float()
            .or(value.as_integer().map(|whole| whole as f64))
    };
    let mut over = Vec::new();
    println!("{:<40} {:>10} {:>10}", "", "measured", "at most");
    for (name, &measured) in figures {
        let of_effect = effects().any(|effect| *name == format!("{effect}_instructions"));
        let limit = most.get(name).or(most.get(EACH).filter(|_| of_effect));
        let limit = limit.and_then(number);
        let limit = limit.ok_or_else(|| format!("{}: no number `{name}`", path.display()))?;
        println!("{name:<40} {measured:>10.1} {limit:>10.1}");
        // NaN exceeds the limit too.
        if !(measured <= limit) {
            over.push(name.as_str());
        }
    }
    println!("{LOAD}");
    if let Some(unmeasured) = most
        .keys()
        .find(|name| *name != EACH && !figures.contains_key(*name))
    {
        return Err(format!(
            "{}: `{unmeasured}` is not measured",
            path.display()
        ));
    }
    if check && !over.is_empty() {
        return Err(format!("over the budget: {}", over.join(", ")));
    }
    Ok(())
}
