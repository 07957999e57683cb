//! `tessuto masks`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tessuto::import::empty_place;
use tessuto::io::mask::Object;
use tessuto::masks::{Border, Click, EmptyPlace, Record, Request, make};
use tessuto::text::quoted;

use crate::ffmpeg::ffmpeg;
use crate::say::{aside, say};
use crate::threads::Threads;
use crate::values::{Places, Polygon};

/// Make the masks of a scene from its frames: where the fabric is, from its corners in the first one.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tessuto masks scenes/towel --plate empty.mp4 \\
    --outline 312,208 930,215 941,640 305,622

  # start from the template, or repeat the last call
  tessuto masks scenes/towel

  # mend masks by clicks: frame:column,row
  tessuto masks scenes/towel --outside 17:610,230 --inside 17:400,300 21:410,305

  # again, without the earlier clicks
  tessuto masks scenes/towel --forget

The camera must stand still, or have its poses in the scene (import --poses). \
Corners are column,row in pixels of the scene's first \
frame, in order around the fabric. Between four of them the border is found by \
colours. More than four, or a mask, are the border as drawn: the first frame's \
mask is just that, also where fabric and surroundings look alike. \
Without corners the template's projection is used.

Writes masks/, masks.json (inputs, and a confidence for every mask) and masks.html, \
the page to check them on, into the scene. The next call starts from the same \
outline, plate and clicks.")]
pub struct Arguments {
    /// Scene folder (holds scene.json, rgbs/).
    scene: PathBuf,
    #[command(flatten)]
    source: Source,
    /// Mask of the first frame, instead of its outline.
    #[arg(long, value_name = "FILE", conflicts_with = "outline")]
    first: Option<PathBuf>,
    /// Clicks on fabric, by frame; added to earlier clicks.
    #[arg(long, value_name = "FRAME:X,Y ...", value_parser = crate::values::places)]
    inside: Vec<Places>,
    /// Clicks beside the fabric, by frame; added to earlier clicks.
    #[arg(long, value_name = "FRAME:X,Y ...", value_parser = crate::values::places)]
    outside: Vec<Places>,
    /// Forget earlier clicks.
    #[arg(long)]
    forget: bool,
    #[command(flatten)]
    threads: Threads,
}

/// Where the fabric is and what is behind it, for `masks` and `import`.
#[derive(Args)]
pub struct Source {
    /// Corners of the fabric in the first frame [px], in order around it, such as "312,208 930,215 941,640 305,622".
    #[arg(long, value_name = "X,Y ...", value_parser = crate::values::polygon, allow_hyphen_values = true)]
    pub outline: Option<Polygon>,
    /// What that outline, or a mask of the first frame, is. More than four corners, and a mask, are drawn.
    #[arg(long, value_name = "KIND")]
    pub border: Option<BorderKind>,
    /// Image, or a second of film, of the scene without the fabric, by the same camera.
    #[arg(long, value_name = "FILE")]
    pub plate: Option<PathBuf>,
    /// Keep only the largest piece of each mask.
    #[arg(long)]
    pub largest_piece: bool,
    #[command(flatten)]
    pub choice: Choice,
}

/// What the border is that somebody gave.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum BorderKind {
    /// The fabric's border: the first frame's mask is what was drawn
    Drawn,
    /// Near the fabric's border, which colours show
    Found,
}

/// Which object of a mask is the fabric, for the commands that read masks.
#[derive(Args)]
pub struct Choice {
    /// Where masks hold several objects, the one that is the fabric: its label (palette index, grey value, or number in
    /// the list that the message gives), or its colour, such as 128,0,0 or #800000.
    #[arg(long, value_name = "N|COLOUR")]
    pub object: Option<Object>,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> anyhow::Result<()> {
    arguments.threads.start()?;
    let side = |places: &[Places], inside: bool| -> Vec<Click> {
        let all = places.iter().flat_map(|p| &p.0);
        all.map(|(frame, [x, y])| Click { frame: *frame, x: *x, y: *y, inside }).collect()
    };
    let mut clicks = side(&arguments.inside, true);
    clicks.extend(side(&arguments.outside, false));
    let plate = arguments.source.plate.as_ref().map(|path| empty_place(path, &ffmpeg())).transpose()?;
    let plate = plate.map(EmptyPlace::Image);
    let (first, forget) = (arguments.first.clone(), arguments.forget);
    let request = Request { first, plate, clicks, forget, ..arguments.source.request() };
    make_masks(&arguments.scene, &arguments.scene, &request)?;
    let scene = quoted(&arguments.scene);
    match arguments.scene.join("template.obj").is_file() {
        true => say!("next: tessuto check {scene} --picture check.png"),
        false => crate::remedy::make_template(&arguments.scene).iter().for_each(|c| say!("next: {c}")),
    }
    Ok(())
}

impl Source {
    /// The request that these options make, without the plate.
    pub fn request(&self) -> Request {
        Request {
            outline: self.outline.clone().map(|p| p.0),
            border: self.border.map(|kind| match kind {
                BorderKind::Drawn => Border::Drawn,
                BorderKind::Found => Border::Found,
            }),
            largest_piece: self.largest_piece,
            object: self.choice.object,
            ..Request::default()
        }
    }
}

/// Makes the masks of the scene in `folder`, and says what came of it; the scene will be at `place`.
pub fn make_masks(folder: &Path, place: &Path, request: &Request) -> anyhow::Result<()> {
    let progress = crate::progress::Fraction::new("masks");
    let made = make(folder, request, &|part| progress.show(part))?;
    progress.end();
    report(place, &made.record);
    Ok(())
}

fn report(folder: &Path, record: &Record) {
    let frames = &record.frames;
    let mean = frames.iter().map(|f| f.confidence).sum::<f64>() / frames.len().max(1) as f64;
    let least = frames.iter().min_by(|a, b| a.confidence.total_cmp(&b.confidence));
    let worst =
        least.map_or_else(String::new, |f| format!(", least {:.2} (frame {})", f.confidence, f.frame));
    say!("{}: {} masks, confidence {mean:.2}{worst}", folder.join("masks").display(), frames.len());
    record.notes.iter().for_each(|note| aside!("note: {note}"));
    for finding in &record.findings {
        match finding.doubtful {
            true => say!("look at {}: {}", finding.frames(), finding.text),
            false => aside!("note: {}: {}", finding.frames(), finding.text),
        }
    }
    if record.doubtful().next().is_some() {
        say!("  mend them: tessuto masks {} --inside \"FRAME:X,Y\" --outside \"FRAME:X,Y\"", quoted(folder));
    }
    say!("page: {}", folder.join("masks.html").display());
}
