//! The commands behind the buttons: lists of arguments, which no shell sees.

use std::path::Path;

use serde::Deserialize;
use tessuto::export::Format;
use tessuto::template::focal;
use tessuto::text::quoted;

use super::form::{Camera, Form, Other, Shape};
use super::work::Work;

/// Longer side of the frames that a part of the clip is chosen from [px].
const PREVIEW_SIDE: &str = "480";
/// Seconds between checkpoints: what a killed run repeats.
const CHECKPOINT: &str = "10";
/// How well a click is known, as `template --camera estimate` has it [px].
const CLICK: f64 = 1.0;

/// What a button does.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "step", rename_all = "lowercase", deny_unknown_fields)]
pub enum Step {
    /// Look at the clip.
    Preview,
    /// The first chosen frame as filmed.
    First,
    /// Scene, masks, template, and the look at them.
    Prepare,
    /// Masks anew, after clicks.
    Masks { inside: Vec<Click>, outside: Vec<Click>, forget: bool },
    /// The whole work.
    Reconstruct,
    /// Files for other programs.
    Export { formats: Vec<String> },
    /// The page anew.
    Report,
}

/// A place in a frame of the scene that is fabric, or is not.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Click {
    frame: usize,
    x: f64,
    y: f64,
}

impl Step {
    /// Under which name its log is kept.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Preview => "preview",
            Self::First => "first",
            Self::Prepare => "prepare",
            Self::Masks { .. } => "masks",
            Self::Reconstruct => "reconstruct",
            Self::Export { .. } => "export",
            Self::Report => "report",
        }
    }
}

/// The arguments of one run of the program, without its name.
pub type Command = Vec<String>;

/// `command` as the user would type it.
pub fn shown(command: &Command) -> String {
    let words = command.iter().map(|word| quoted(Path::new(word)));
    std::iter::once("tessuto".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// The commands of a step.
///
/// # Errors
/// A sentence that says what is missing.
pub fn of(work: &Work, form: &Form, step: &Step) -> Result<Vec<Command>, String> {
    form.check()?;
    let (scene, result) = (work.scene(), work.result());
    match step {
        Step::Preview => {
            let out = work.beside("preview");
            let force = work.has(&out);
            let mut command =
                vec!["frames".into(), clip(form)?, argument(&out), "--side".into(), PREVIEW_SIDE.into()];
            command.extend(rate(form));
            Ok(vec![forced(command, force)])
        }
        Step::First => {
            let out = work.beside("first");
            let start = form.frames.map_or(0, |[a, _]| a);
            let range = format!("{start}..{}", start + 1);
            let force = work.has(&out);
            let mut command = vec!["frames".into(), clip(form)?, argument(&out), "--frames".into(), range];
            command.extend(rate(form));
            Ok(vec![forced(command, force)])
        }
        Step::Prepare => prepare(work, form),
        Step::Masks { inside, outside, forget } => {
            let mut command = vec!["masks".into(), argument(scene)];
            for (option, clicks) in [("--inside", inside), ("--outside", outside)] {
                if clicks.iter().any(|c| !(c.x.abs() < 1e6 && c.y.abs() < 1e6)) {
                    return Err("a click is far outside of the image".to_owned());
                }
                if !clicks.is_empty() {
                    let text: Vec<_> = clicks
                        .iter()
                        .map(|c| format!("{}:{},{}", c.frame, number(c.x), number(c.y)))
                        .collect();
                    command.extend([option.into(), text.join(" ")]);
                }
            }
            if *forget {
                command.push("--forget".into());
            }
            Ok(vec![command, check(work)])
        }
        Step::Reconstruct => Ok(vec![reconstruct(work, form)]),
        Step::Export { formats } => {
            let built: Vec<_> = Format::built().map(Format::key).collect();
            if formats.is_empty() || !formats.iter().all(|f| built.contains(&f.as_str())) {
                return Err(format!("choose formats among {}", built.join(", ")));
            }
            Ok(vec![vec![
                "export".into(),
                argument(&result),
                "--to".into(),
                formats.join(","),
                "--force".into(),
            ]])
        }
        Step::Report => Ok(vec![vec!["report".into(), argument(&result)]]),
    }
}

/// How fast the clip was filmed, where that was entered.
fn rate(form: &Form) -> impl Iterator<Item = String> {
    form.rate.into_iter().flat_map(|rate| ["--rate".to_owned(), number(rate)])
}

/// Clip to scene, masks and template.
fn prepare(work: &Work, form: &Form) -> Result<Vec<Command>, String> {
    if form.shape == Shape::Other {
        return on_table(work, form);
    }
    let scene = argument(work.scene());
    let Some(corners) = form.corners() else {
        return Err("click the four corners of the sheet in the first frame".to_owned());
    };
    let Some([width, height]) = form.size else {
        return Err("enter width and height of the sheet".to_owned());
    };
    let mut commands = Vec::new();
    let estimated = is_estimated(work, form);
    if estimated {
        states_focal_length(work, form, [width, height], corners)?;
    }
    if form.clip.is_some() {
        let mut import = import(work, form, form.masks.as_deref())?;
        import.extend(camera(&form.camera, estimated));
        commands.push(forced(import, work.has(&format!("{}/scene.json", work.scene()))));
    } else {
        commands.push(masks(work, form));
    }
    let mut template = vec!["template".into(), scene, "--flat".into()];
    template.push(format!("{}x{}m", metres(width), metres(height)));
    template.push("--corners".into());
    template.extend(corners.map(|c| pair(form.in_scene(c))));
    if estimated {
        template.extend(camera(&Camera::Auto, true));
    }
    template.push("--force".into());
    commands.extend([template, check(work)]);
    Ok(commands)
}

/// Clip to scene, masks and template of fabric of any shape, which lies on a table below the camera.
fn on_table(work: &Work, form: &Form) -> Result<Vec<Command>, String> {
    let Other { between, distance } = form.other()?;
    if is_estimated(work, form) {
        return Err(
            "the clip does not name its camera, and only a sheet's corners show it: enter the camera"
                .to_owned(),
        );
    }
    let mut commands = Vec::new();
    if form.clip.is_some() {
        let mut import = import(work, form, form.masks.as_deref())?;
        import.extend(camera(&form.camera, false));
        commands.push(forced(import, work.has(&format!("{}/scene.json", work.scene()))));
    } else {
        commands.push(masks(work, form));
    }
    let mut template = vec!["template".into(), argument(work.scene()), "--on-table".into()];
    template.extend(["--distance".into(), format!("{}m", metres(distance)), "--between".into()]);
    template.extend(between.map(|p| pair(form.in_scene(p))));
    template.extend(["--tilt", "facing", "--force"].map(str::to_owned));
    commands.extend([template, check(work)]);
    Ok(commands)
}

/// The command that makes the masks of a scene that is there.
fn masks(work: &Work, form: &Form) -> Command {
    let mut command = vec!["masks".into(), argument(work.scene())];
    command.extend(outline(form));
    command
}

/// The border, and what it is: between the corners of a sheet the points show where it bends, and colours where it
/// is; any other is as it was drawn.
fn outline(form: &Form) -> Command {
    let points: Vec<_> = form.outline.iter().map(|p| pair(form.in_scene([p.x, p.y]))).collect();
    let border = match form.shape {
        Shape::Sheet if points.len() > 4 => Some("found"),
        Shape::Sheet => None,
        Shape::Other => Some("drawn"),
    };
    let mut options = vec!["--outline".into(), points.join(" ")];
    options.extend(border.iter().flat_map(|border| ["--border", border]).map(str::to_owned));
    options
}

/// What makes a scene of the clip of a camera that moved, each with what it needs: the poses that an app on the phone
/// recorded; poses from the clip, by this program or by COLMAP, with masks of another program. Words in capitals stand
/// for files of the user. `None` without a clip and its border.
pub fn of_moving_camera(work: &Work, form: &Form) -> Option<Vec<(&'static str, String)>> {
    match form.shape {
        Shape::Sheet => form.corners().map(|_| ())?,
        Shape::Other => form.other().map(|_| ()).ok()?,
    }
    let command = |masks: Option<&str>, options: [&str; 2]| {
        let mut import = import(work, form, masks).ok()?;
        match is_estimated(work, form) {
            // The corners come after the poses, which need the lens.
            true => import.extend(["--fov", "DEGREES"].map(str::to_owned)),
            false => import.extend(camera(&form.camera, false)),
        }
        import.extend(options.map(str::to_owned));
        Some(shown(&forced(import, work.has(&format!("{}/scene.json", work.scene())))))
    };
    let masks = form.masks.as_deref().unwrap_or("MASKS");
    Some(vec![
        (
            "an app on the phone recorded where it was",
            command(form.masks.as_deref(), ["--poses", "CAPTURE"])?,
        ),
        (
            "the hand shook: masks of another program, the way from the clip",
            command(Some(masks), ["--camera-motion", "estimate"])?,
        ),
        (
            "somebody walked: the same by the program colmap",
            command(Some(masks), ["--camera-motion", "colmap"])?,
        ),
    ])
}

/// The command that makes a scene of the clip, without its camera.
fn import(work: &Work, form: &Form, masks: Option<&str>) -> Result<Command, String> {
    let mut import = vec!["import".into(), clip(form)?, argument(work.scene())];
    if let Some([a, b]) = form.frames {
        import.extend(["--frames".into(), format!("{a}..{b}")]);
    }
    import.extend(rate(form));
    for (option, value) in [("--stride", form.stride), ("--downscale", form.downscale)] {
        if value > 1 {
            import.extend([option.into(), value.to_string()]);
        }
    }
    match masks {
        Some(masks) => {
            import.extend(["--masks".into(), argument(masks)]);
            import.extend(form.object.iter().flat_map(|object| ["--object".to_owned(), object.clone()]));
        }
        None => import.extend(outline(form)),
    }
    import.extend(form.plate.iter().flat_map(|plate| ["--plate".to_owned(), argument(plate)]));
    Ok(import)
}

fn check(work: &Work) -> Command {
    let image = argument(&work.beside("check.png"));
    vec!["check".into(), argument(work.scene()), "--picture".into(), image]
}

fn reconstruct(work: &Work, form: &Form) -> Command {
    let result = work.result();
    let mut command: Command = vec![
        "reconstruct".into(),
        argument(work.scene()),
        "--out".into(),
        argument(&result),
        "--live".into(),
    ];
    command.extend(["--checkpoint".into(), CHECKPOINT.into()]);
    if !form.appearance {
        command.push("--no-appearance".into());
    }
    if work.has(&format!("{result}.checkpoints")) {
        command.push("--resume".into());
    }
    forced(command, work.has(&result))
}

fn clip(form: &Form) -> Result<String, String> {
    form.clip.as_deref().map(argument).ok_or_else(|| "choose a clip first".to_owned())
}

/// Whether neither the user nor the clip states the camera, so that the corners must show it.
fn is_estimated(work: &Work, form: &Form) -> bool {
    let told = || work.json(&work.beside("preview/clip.json")).is_some_and(|clip| clip["lens"].is_number());
    form.clip.is_some() && form.camera == Camera::Auto && !told()
}

/// Refuses corners that do not determine the focal length, before minutes are spent on masks. Of the scene's
/// pixels, as the command for the template sees them.
fn states_focal_length(
    work: &Work,
    form: &Form,
    size: [f64; 2],
    corners: [[f64; 2]; 4],
) -> Result<(), String> {
    let Some(clip) = work.json(&work.beside("preview/clip.json")) else { return Ok(()) };
    let side = |name: &str| clip[name].as_u64().map(|n| n as usize / form.downscale.max(1));
    let (Some(width), Some(height)) = (side("width"), side("height")) else { return Ok(()) };
    let corners = corners.map(|c| form.in_scene(c).into());
    focal::estimate(size.into(), corners, [width, height], CLICK)
        .map(|_| ())
        .map_err(|error| format!("the clip does not name its camera; {error}"))
}

fn camera(camera: &Camera, estimated: bool) -> Command {
    let options =
        |pairs: &[(&str, f64)]| pairs.iter().flat_map(|(o, v)| [(*o).to_owned(), number(*v)]).collect();
    match camera {
        Camera::Auto if estimated => vec!["--camera".into(), "estimate".into()],
        Camera::Auto => Vec::new(),
        Camera::Fov { fov, .. } => options(&[("--fov", *fov)]),
        Camera::Focal { fx, fy, centre } => {
            let mut pairs = vec![("--fx", *fx)];
            pairs.extend(fy.map(|fy| ("--fy", fy)));
            pairs.extend(centre.iter().flat_map(|[x, y]| [("--cx", *x), ("--cy", *y)]));
            options(&pairs)
        }
        Camera::File { file } => vec!["--camera".into(), argument(file)],
    }
}

fn forced(mut command: Command, force: bool) -> Command {
    if force {
        command.push("--force".into());
    }
    command
}

/// A name that cannot be read as an option.
fn argument(name: &str) -> String {
    if name.starts_with('-') { format!("./{name}") } else { name.to_owned() }
}

fn pair([x, y]: [f64; 2]) -> String {
    format!("{},{}", number(x), number(y))
}

/// Thousandths are enough for pixels and degrees, and are read easily.
fn number(value: f64) -> String {
    format!("{}", (value * 1e3).round() / 1e3)
}

/// Hundredths of a millimetre are enough.
fn metres(value: f64) -> String {
    format!("{}", (value * 1e5).round() / 1e5)
}

#[cfg(test)]
mod tests {
    use super::super::form::Point;
    use super::super::place::Project;
    use super::*;

    fn form() -> Form {
        let point = |x, y, corner| Point { x, y, corner, measured: false };
        Form {
            clip: Some("-it's; $(touch x).mp4".into()),
            frames: Some([3, 20]),
            downscale: 2,
            outline: vec![
                point(10.5, 20.5, true),
                point(30.5, 18.5, false),
                point(50.5, 20.5, true),
                point(50.5, 60.5, true),
                point(10.5, 60.5, true),
            ],
            size: Some([0.55, 0.56]),
            camera: Camera::Focal { fx: 800.0, fy: None, centre: Some([319.5, 319.5]) },
            ..Form::default()
        }
    }

    #[test]
    fn commands_are_lists_and_shown_as_typed() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        let work = Work::new(&project, "scenes/a").unwrap();
        let commands = of(&work, &form(), &Step::Prepare).unwrap();
        // One argument each, however odd the name is, and none that starts like an option.
        assert_eq!(commands[0][..3], ["import", "./-it's; $(touch x).mp4", "scenes/a"]);
        let text: Vec<_> = commands.iter().map(shown).collect();
        let import = concat!(
            r"tessuto import './-it'\''s; $(touch x).mp4' scenes/a --frames 3..20 --downscale 2 ",
            "--outline '5,10 15,9 25,10 25,30 5,30' --border found --fx 800 --cx 319.5 --cy 319.5"
        );
        assert_eq!(text[0], import);
        assert_eq!(
            text[1],
            "tessuto template scenes/a --flat 0.55x0.56m --corners 5,10 25,10 25,30 5,30 --force"
        );
        assert_eq!(text[2], "tessuto check scenes/a --picture scenes/a.studio/check.png");
        let step = r#"{"step":"masks","inside":[{"frame":3,"x":1.5,"y":2}],"outside":[],"forget":false}"#;
        let step: Step = serde_json::from_str(step).unwrap();
        assert_eq!(shown(&of(&work, &form(), &step).unwrap()[0]), "tessuto masks scenes/a --inside 3:1.5,2");
        assert!(of(&work, &form(), &Step::Export { formats: vec!["glb".into(), "--out=/".into()] }).is_err());
        assert!(of(&work, &Form { size: None, ..form() }, &Step::Prepare).unwrap_err().contains("width"));
        assert!(
            of(&work, &Form { outline: vec![], ..form() }, &Step::Prepare)
                .unwrap_err()
                .contains("four corners")
        );
    }

    #[test]
    fn fabric_of_another_shape_lies_on_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        let work = Work::new(&project, "scenes/a").unwrap();
        let point = |x, y, measured| Point { x, y, corner: false, measured };
        let vest = Form {
            shape: Shape::Other,
            outline: vec![
                point(10.5, 20.5, true),
                point(30.5, 40.5, false),
                point(50.5, 20.5, true),
                point(30.5, 80.5, false),
            ],
            closed: true,
            distance: Some(0.62),
            size: None,
            ..form()
        };
        let text: Vec<_> = of(&work, &vest, &Step::Prepare).unwrap().iter().map(shown).collect();
        assert!(
            text[0].contains("--outline '5,10 15,20 25,10 15,40' --border drawn --fx 800"),
            "{}",
            text[0]
        );
        let template =
            "tessuto template scenes/a --on-table --distance 0.62m --between 5,10 25,10 --tilt facing";
        assert_eq!(text[1], format!("{template} --force"));
        assert!(text[2].starts_with("tessuto check"));
        // Of a scene that is there, the masks are made anew.
        let text = of(&work, &Form { clip: None, ..vest.clone() }, &Step::Prepare).unwrap();
        assert!(shown(&text[0]).starts_with("tessuto masks scenes/a --outline"), "{text:?}");
        let lacks = |form: Form| of(&work, &form, &Step::Prepare).unwrap_err();
        assert!(lacks(Form { closed: false, ..vest.clone() }).contains("click points around"));
        assert!(lacks(Form { distance: None, ..vest.clone() }).contains("distance"));
        assert!(lacks(Form { camera: Camera::Auto, ..vest.clone() }).contains("enter the camera"));
        let mut unnamed = vest.clone();
        unnamed.outline[0].measured = false;
        assert!(lacks(unnamed).contains("two points"));
        assert!(of_moving_camera(&work, &vest).unwrap()[0].1.contains("--border drawn"));
    }

    #[test]
    fn masks_of_another_program_take_the_place_of_the_outline() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        let work = Work::new(&project, "scenes/a").unwrap();
        let masks = |object: Option<&str>| {
            let form = Form { masks: Some("my masks".into()), object: object.map(Into::into), ..form() };
            of(&work, &form, &Step::Prepare).map(|commands| shown(&commands[0]))
        };
        let import = masks(None).unwrap();
        assert!(import.contains(" --masks 'my masks' --fx") && !import.contains("--outline"), "{import}");
        assert!(masks(Some("128,0,0")).unwrap().contains(" --masks 'my masks' --object 128,0,0 --fx"));
        for wrong in ["", "-1", "3 --force", "12345678901234567"] {
            assert!(masks(Some(wrong)).unwrap_err().contains("object"), "{wrong}");
        }
    }

    #[test]
    fn a_camera_that_moved_has_finished_commands() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        let work = Work::new(&project, "scenes/a").unwrap();
        let offers = of_moving_camera(&work, &form()).unwrap();
        let texts: Vec<&str> = offers.iter().map(|(_, command)| command.as_str()).collect();
        assert!(texts.iter().all(|text| text.starts_with("tessuto import ") && text.contains("--fx 800")));
        assert!(texts[0].contains("--outline") && texts[0].contains("--poses CAPTURE"), "{texts:?}");
        for (text, by) in texts[1..].iter().zip(["estimate", "colmap"]) {
            assert!(text.contains("--masks MASKS") && !text.contains("--outline"), "{text}");
            assert!(text.contains(&format!("--camera-motion {by}")), "{text}");
        }
        let given = Form { masks: Some("seen.mp4".into()), ..form() };
        let offers = of_moving_camera(&work, &given).unwrap();
        assert!(offers.iter().all(|(_, command)| command.contains("--masks seen.mp4")), "{offers:?}");
        let unknown = of_moving_camera(&work, &Form { camera: Camera::Auto, ..form() }).unwrap();
        assert!(unknown.iter().all(|(_, command)| command.contains("--fov DEGREES")), "{unknown:?}");
        assert_eq!(of_moving_camera(&work, &Form { outline: Vec::new(), ..form() }), None);
    }

    #[test]
    fn the_corners_tell_the_camera_where_nobody_else_does() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        let work = Work::new(&project, "scenes/a").unwrap();
        let form = Form { camera: Camera::Auto, ..form() };
        let estimates = || -> Vec<bool> {
            let commands = of(&work, &form, &Step::Prepare).unwrap();
            commands.iter().map(|c| shown(c).contains("--camera estimate")).collect()
        };
        assert_eq!(estimates(), [true, true, false]);
        // A sheet seen from the front is refused before anything is run, one that is tilted is not.
        let clip = folder.path().join("scenes/a.studio/preview/clip.json");
        std::fs::create_dir_all(clip.parent().unwrap()).unwrap();
        std::fs::write(&clip, r#"{"lens": null, "width": 640, "height": 480}"#).unwrap();
        let points =
            |at: [[f64; 2]; 4]| at.map(|[x, y]| Point { x, y, corner: true, measured: false }).to_vec();
        let frontal = Form {
            outline: points([[200.0, 100.0], [440.0, 100.0], [440.0, 340.0], [200.0, 340.0]]),
            size: Some([0.5, 0.5]),
            ..form.clone()
        };
        let told = of(&work, &frontal, &Step::Prepare).unwrap_err();
        assert!(
            told.contains("do not determine the focal length") && told.contains("give the camera"),
            "{told}"
        );
        let tilted = Form {
            outline: points([[149.4, 105.1], [440.1, 21.9], [516.7, 395.4], [259.6, 347.5]]),
            size: Some([0.5, 0.5]),
            ..form.clone()
        };
        let result = of(&work, &tilted, &Step::Prepare);
        assert!(result.is_ok(), "{result:?}");
        std::fs::create_dir_all(folder.path().join("scenes/a.studio/preview")).unwrap();
        std::fs::write(folder.path().join("scenes/a.studio/preview/clip.json"), r#"{"lens": 26.0}"#).unwrap();
        assert_eq!(estimates(), [false, false, false]);
    }

    #[test]
    fn a_killed_run_is_resumed_and_a_finished_one_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let project = Project::open(folder.path()).unwrap();
        let work = Work::new(&project, "scenes/a").unwrap();
        let text = || shown(&of(&work, &Form::default(), &Step::Reconstruct).unwrap()[0]);
        let fresh = "tessuto reconstruct scenes/a --out results/a --live --checkpoint 10";
        assert_eq!(text(), fresh);
        std::fs::create_dir_all(folder.path().join("results/a.checkpoints")).unwrap();
        assert_eq!(text(), format!("{fresh} --resume"));
        std::fs::create_dir_all(folder.path().join("results/a")).unwrap();
        assert_eq!(text(), format!("{fresh} --resume --force"));
    }
}
