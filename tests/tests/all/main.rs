//! Estimators and diagnosis from recording to result, on the virtual bench and on real units.

mod agreement;
mod coverage;
mod diagnosis;
mod few_poses;
mod flaws;
mod joint;
mod judgement;
mod module_circles;
mod next_experiment;
mod noise_of_the_bench;
mod papers;
mod planted;
mod public_data;
mod ramps;
mod real_ferraris;
mod real_halves;
mod real_mikoff;
mod real_xsens;
mod record_player;
mod recording_problems;
mod several_recordings;
mod signed_low_byte;
mod stated_noise;
mod strong_nonlinearity;
mod temperature;
mod turning;
