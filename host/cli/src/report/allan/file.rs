//! The noise file, `mimu-noise/1`.

use std::fmt::Write as _;

use mimu::allan::model::Term;
use mimu::allan::recording::Survey;

/// Text of the noise file of surveys of one unit, each at its own temperature; empty without one.
pub fn allan_toml(surveys: &[Survey]) -> String {
    let quoted = |text: &str| toml::Value::String(text.into()).to_string();
    let mut out = String::new();
    let Some(first) = surveys.first() else {
        return out;
    };
    let lengths = surveys.iter().map(|s| s.span_s[1] - s.span_s[0]);
    let _ = writeln!(
        out,
        "# Noise of an inertial unit at rest: sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3 + R^2 tau^2/2.\n\
         # A coefficient that the record does not show is absent, and its reason is there.\n\
         format = \"{}\"\ndevice = {}\nsample_rate_hz = {:?}\nduration_s = {:?}\nconfidence = {:?}",
        mimu::noise_file::NOISE_FORMAT,
        quoted(&first.device),
        first.sample_rate_hz,
        lengths.fold(f64::INFINITY, f64::min),
        first.options.confidence
    );
    let channels = surveys
        .iter()
        .flat_map(|survey| survey.channels.iter().map(move |c| (survey, c)));
    for (survey, channel) in channels {
        let _ = writeln!(
            out,
            "\n[[channel]]\nname = \"{}\"\nunit = \"{}\"\nsamples = {}",
            channel.name, channel.unit.name, channel.samples
        );
        if let Some(temp_c) = survey.temp_c {
            let _ = writeln!(out, "temp_c = {temp_c:.3}");
        }
        for term in Term::ALL {
            let key = term.letter().to_lowercase();
            let _ = match channel.model.as_ref().map(|m| m.get(term)) {
                Some(Ok(c)) => writeln!(
                    out,
                    "{key} = {{ value = {:e}, sigma = {:e}, lower = {:e}, upper = {:e}, unit = \"{}\" }}  # {}",
                    c.value,
                    c.sigma,
                    c.lower,
                    c.upper,
                    channel.unit.coefficient(term),
                    term.name()
                ),
                Some(Err(why)) => writeln!(out, "{key}_reason = {}", quoted(why)),
                None => writeln!(out, "{key}_reason = {}", quoted(super::text::TOO_SHORT)),
            };
        }
    }
    out
}
