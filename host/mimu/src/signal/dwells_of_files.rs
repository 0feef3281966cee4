//! Files of a sequence that hold many dwells each: one file for each rate of a turntable, with the unit in many orientations.

use std::ops::Range;

use crate::fault::SHORTEST_S;
use crate::signal::blocks::Condensed;
use crate::signal::rest;
use crate::signal::stillness;
use mimu_recording::{Manifest, Result};

/// A file of which one dwell covers this share is that dwell.
const WHOLE: f64 = 0.9;

/// Numbers the dwells within the files of a sequence on a turntable, one after another, instead of the files. A dwell of the file `33` is
/// labelled `33/1` and has the rate that the manifest gives for the file. Nothing changes if each file is a single dwell.
pub(crate) fn number(
    condensed: &mut Condensed,
    manifest: &mut Manifest,
    factor: f64,
) -> Result<()> {
    let mut ranges = stillness::find(condensed, manifest, factor)?.ranges;
    rest::walk_in(&mut ranges, condensed, rest::AT_ENDS_OF_TURNS);
    let longest = condensed.blocks.iter().map(|b| b.rows).max().unwrap_or(1);
    let fewest = (SHORTEST_S / (f64::from(longest) * condensed.period_s)).round() as usize;
    let long = ranges.into_iter().map(|(_, range)| range);
    let found: Vec<Range<usize>> = long.filter(|r| r.len() >= fewest).collect();
    let mut files: Vec<(i32, Range<usize>, Vec<Range<usize>>)> = Vec::new();
    for (i, block) in condensed.blocks.iter().enumerate() {
        match files.last_mut() {
            Some((step, range, _)) if *step == block.step => range.end = i + 1,
            _ => files.push((block.step, i..i + 1, Vec::new())),
        }
    }
    for (_, file, dwells) in &mut files {
        let own = found
            .iter()
            .filter(|d| file.start <= d.start && d.end <= file.end);
        dwells.extend(own.cloned());
        let whole = |d: &Range<usize>| d.len() as f64 >= WHOLE * file.len() as f64;
        if dwells.is_empty() || dwells.iter().any(whole) {
            *dwells = vec![file.clone()];
        }
    }
    if files.iter().all(|(_, _, dwells)| dwells.len() == 1) {
        return Ok(());
    }
    let given = manifest.turntable.as_ref();
    let given = given.map_or_else(Default::default, |t| t.step_rates_dps.clone());
    let mut rates = given.clone();
    let mut labels = Vec::new();
    for (step, file, dwells) in files {
        let name = manifest.step_name(step);
        let names = [name.clone(), step.to_string()];
        let rate = names.iter().find_map(|name| given.get(name));
        rates.retain(|name, _| !names.contains(name));
        condensed.blocks[file].iter_mut().for_each(|b| b.step = -1);
        for (k, dwell) in dwells.into_iter().enumerate() {
            let label = format!("{name}/{}", k + 1);
            rates.extend(rate.map(|rate| (label.clone(), *rate)));
            let number = labels.len() as i32;
            condensed.blocks[dwell]
                .iter_mut()
                .for_each(|b| b.step = number);
            labels.push(label);
        }
    }
    if let Some(turntable) = &mut manifest.turntable {
        turntable.step_rates_dps = rates;
    }
    manifest.step_labels = labels;
    Ok(())
}
