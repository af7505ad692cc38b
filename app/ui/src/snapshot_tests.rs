//! Images of the whole window in its main states, compared with those in `tests/snapshots`.
//!
//! They are drawn on the processor, by Mesa's llvmpipe through Vulkan, so that every machine draws the same. The
//! tolerance is set in `kittest.toml`. After an intended change: `UPDATE_SNAPSHOTS=1 ./test -p handeye_ui --lib
//! snapshot`, and look at each image before it is committed.

use std::sync::Arc;

use egui::{Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::wgpu::WgpuTestRenderer;
use egui_wgpu::{RenderState, RendererOptions, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew, wgpu};
use handeye_geometry::testing::{Need, skip};

use super::testing::Silent;
use handeye_workbench::model::{CellSource, LinkState, Model, Pane, Step, ThemeChoice, ViewSettings};
use handeye_workbench::shell;
use handeye_workbench::testing::sample;
use handeye_workbench::text::{Language, Text};

/// Small enough for a repository, large enough for everything; the harness takes 8 of them at each edge \[points\].
const SIZE: Vec2 = vec2(1280.0, 800.0);

/// Draws on the processor through Vulkan; returns the reason on a machine that cannot.
fn renderer() -> Result<WgpuTestRenderer, egui_wgpu::WgpuError> {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = wgpu::Backends::VULKAN;
    // A graphics card rounds differently.
    setup.native_adapter_selector = Some(Arc::new(|adapters, _surface| {
        let on_processor = |adapter: &&wgpu::Adapter| adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        adapters.iter().find(on_processor).cloned().ok_or_else(|| "no Vulkan device on the processor".to_owned())
    }));
    let setup = WgpuSetup::CreateNew(setup);
    let instance = pollster::block_on(setup.new_instance());
    let configuration = WgpuConfiguration { wgpu_setup: setup, ..WgpuConfiguration::default() };
    let options = RendererOptions::PREDICTABLE;
    let state = pollster::block_on(RenderState::create(&configuration, &instance, None, options))?;
    Ok(WgpuTestRenderer::from_render_state(state))
}

/// What is shown.
struct State {
    model: Model,
    step: Option<Step>,
    panes: &'static [Pane],
}

impl State {
    fn new(model: Model) -> Self {
        Self { model, step: None, panes: &[] }
    }

    /// With the panes of a step in front.
    fn at(mut self, step: Step) -> Self {
        self.step = Some(step);
        self
    }

    /// With these in front.
    fn with(mut self, panes: &'static [Pane]) -> Self {
        self.panes = panes;
        self
    }
}

/// Draws it and compares it with the image of that name.
fn looks_like(name: &str, theme: ThemeChoice, language: Language, state: State) {
    let renderer = match renderer() {
        Ok(renderer) => renderer,
        Err(error) => {
            skip(
                Need::Vulkan,
                &format!("{name} is not drawn: {error}. On Debian: apt-get install mesa-vulkan-drivers"),
            );
            return;
        }
    };
    let builder = Harness::builder().with_size(SIZE).renderer(renderer);
    let mut silent = Silent::built(CellSource::default(), builder);
    let State { mut model, step, panes } = state;
    model.view.theme = theme;
    model.view.language = language;
    // The harness keeps its sessions in a different folder each time.
    model.sessions = "/home/me/handeye-sessions".into();
    silent.show_model(model);
    if let Some(step) = step {
        silent.command(shell::Command::GoToStep(step));
    }
    for &pane in panes {
        silent.show(pane);
    }
    silent.harness.snapshot(name);
}

/// Nothing has ever answered.
fn searching() -> Model {
    let address = "tcp://127.0.0.1:23000".to_owned();
    let searching =
        LinkState::Searching { address: address.clone(), attempt: 3, why: Some(Text::verbatim("nothing answers")) };
    let mut model = Model::new(CellSource::Address(address), ViewSettings::default());
    model.now_s = 100.0;
    model.control = searching.clone();
    model.camera = searching.clone();
    model.mover = searching;
    model
}

/// Solved, and then the cable was pulled: the images are as old as the loss.
fn lost() -> Model {
    let since_s = 88.0;
    let lost =
        LinkState::Lost { since_s, why: Text::verbatim("the cell closed the connection"), attempt: 2, next_s: since_s };
    let mut model = sample::solved();
    if let Some(frame) = &mut model.frame {
        frame.info.received_s = since_s;
    }
    model.control = lost.clone();
    model.camera = lost.clone();
    model.mover = lost;
    model
}

const DARK: ThemeChoice = ThemeChoice::Dark;
const LIGHT: ThemeChoice = ThemeChoice::Light;
const ENGLISH: Language = Language::English;
const CHINESE: Language = Language::Chinese;

#[test]
fn snapshot_of_the_start_without_a_connection() {
    looks_like("start_dark_en", DARK, ENGLISH, State::new(searching()));
}

#[test]
fn snapshot_of_live_images_with_nothing_captured() {
    looks_like("live_dark_en", DARK, ENGLISH, State::new(sample::connected()).at(Step::Target));
}

#[test]
fn snapshot_of_the_result_in_the_dark_theme() {
    looks_like("solved_dark_en", DARK, ENGLISH, State::new(sample::solved()).with(&[Pane::Poses, Pane::Result]));
}

#[test]
fn snapshot_of_the_result_in_the_light_theme() {
    looks_like("solved_light_en", LIGHT, ENGLISH, State::new(sample::solved()).at(Step::Solve));
}

#[test]
fn snapshot_of_the_result_in_the_dark_theme_in_chinese() {
    looks_like("solved_dark_zh", DARK, CHINESE, State::new(sample::solved()).at(Step::Solve));
}

#[test]
fn snapshot_of_the_result_in_the_light_theme_in_chinese() {
    looks_like("solved_light_zh", LIGHT, CHINESE, State::new(sample::solved()).with(&[Pane::Poses, Pane::Result]));
}

#[test]
fn snapshot_of_a_lost_connection() {
    looks_like("lost_light_zh", LIGHT, CHINESE, State::new(lost()).with(&[Pane::Connect]));
}

#[test]
fn snapshot_of_jogging() {
    looks_like("jog_dark_en", DARK, ENGLISH, State::new(sample::captured()).at(Step::Capture));
}

#[test]
fn snapshot_of_the_export() {
    looks_like("export_light_en", LIGHT, ENGLISH, State::new(sample::previewed()).at(Step::Export));
}

#[test]
fn snapshot_of_the_verification() {
    looks_like("verify_dark_zh", DARK, CHINESE, State::new(sample::solved()).at(Step::Verify));
}

#[test]
fn snapshot_of_tracking() {
    looks_like("track_dark_en", DARK, ENGLISH, State::new(sample::tracking()).at(Step::Track));
}

#[test]
fn snapshot_of_the_cell_in_three_dimensions() {
    let mut model = sample::tracking();
    model.track = handeye_workbench::model::TrackState::default();
    model.selection = vec![handeye_session::CaptureId(4)];
    model.scene.distance_m = 1.4;
    model.scene.centre_m = [0.2, 0.0, 0.25];
    looks_like("scene_light_zh", LIGHT, CHINESE, State::new(model).with(&[Pane::Scene, Pane::Poses]));
}
