//! What the page shows, derived from what is on disk each time it asks.

use std::path::Path;
use std::time::SystemTime;

use serde_json::{Value, json};
use tessuto::export::{Format, use_of};

use super::commands::{self, Step};
use super::log::{self, News};
use super::routes::Studio;
use super::work::Work;
use super::{entries, place};

/// The project, and `work` if one is open.
pub fn state(studio: &Studio, work: Option<&Work>) -> Value {
    let project = &studio.project;
    let busy = studio.jobs.latest().filter(|job| job.is_running());
    json!({
        "project": project.root().display().to_string(),
        "start": studio.start,
        "formats": Format::built().map(|f| json!({ "key": f.key(), "programs": f.programs() })).collect::<Vec<_>>(),
        "busy": busy.map(|job| json!({ "work": job.work, "step": job.step })),
        "entries": if work.is_none() { json!(entries::list(project)) } else { Value::Null },
        "work": work.map(|work| of(studio, work)),
    })
}

fn of(studio: &Studio, work: &Work) -> Value {
    let form = work.form();
    let (scene, result) = (work.scene(), work.result());
    let in_scene = |part: &str| format!("{scene}/{part}");
    let commands = |step: &Step| {
        commands::of(work, &form, step).map(|c| c.iter().map(commands::shown).collect::<Vec<_>>()).ok()
    };
    let export = Step::Export { formats: vec!["glb".into(), "usd".into()] };
    json!({
        "name": scene,
        "result_name": result,
        "is_result": work.is_result(),
        "form": form,
        "form_version": work.form_version(),
        "clip": work.json(&work.beside("preview/clip.json")),
        "preview": work.beside("preview"),
        "first": work.json(&work.beside("first/clip.json")).map(|c| c["frames"][0].clone()),
        "first_folder": work.beside("first"),
        "scene": work.json(&in_scene("scene.json")),
        "scene_version": version(work, &in_scene("scene.json")),
        "masks_version": version(work, &in_scene("masks")).max(version(work, &in_scene("masks.json"))),
        "template_version": version(work, &in_scene("template.obj")),
        "masks": work.json(&in_scene("masks.json")),
        "template": work.json(&in_scene("template.json")),
        "result": work.has(&result).then(|| version(work, &format!("{result}/manifest.json"))).flatten(),
        "report_version": version(work, &format!("{result}/report.html")),
        "findings": findings(work),
        "summary": work.json(&format!("{result}/summary.json")),
        "interrupted": work.has(&format!("{result}.checkpoints")),
        "export_folder": work.project.find(&format!("{result}/export")).map(|path| path.display().to_string()),
        "exports": files(work, &format!("{result}/export")),
        "export_folders": folders(work, &format!("{result}/export")),
        "commands": {
            "prepare": commands(&Step::Prepare),
            "moving": commands::of_moving_camera(work, &form),
            "reconstruct": commands(&Step::Reconstruct),
            "export": commands(&export),
        },
        "job": job(studio, work),
    })
}

/// When the file or folder was last changed [ms since 1970].
fn version(work: &Work, name: &str) -> Option<u64> {
    let changed = work.project.find(name)?.metadata().ok()?.modified().ok()?;
    let since = changed.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    u64::try_from(since.as_millis()).ok()
}

/// Names and sizes of the files in a folder.
fn files(work: &Work, folder: &str) -> Vec<Value> {
    let Some(entries) = work.project.find(folder).and_then(|f| f.read_dir().ok()) else { return Vec::new() };
    let mut files: Vec<_> = entries
        .flatten()
        .filter_map(|e| {
            let (name, data) = (e.file_name().to_str()?.to_owned(), e.metadata().ok()?);
            (data.is_file() && place::is_name(&name)).then_some((name, data.len()))
        })
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|(name, bytes)| json!({ "name": format!("{folder}/{name}"), "bytes": bytes, "use": use_of(&name) }))
        .collect()
}

/// Names of the folders in a folder, and how many files each holds.
fn folders(work: &Work, folder: &str) -> Vec<Value> {
    let Some(entries) = work.project.find(folder).and_then(|f| f.read_dir().ok()) else { return Vec::new() };
    let named = |e: std::fs::DirEntry| {
        let name = e.file_name().to_str().filter(|name| place::is_name(name))?.to_owned();
        e.file_type().ok()?.is_dir().then_some(name)
    };
    let mut names: Vec<String> = entries.flatten().filter_map(named).collect();
    names.sort();
    let counted = |name: &String| {
        json!({
            "name": format!("{folder}/{name}"),
            "files": files(work, &format!("{folder}/{name}")).len(),
            "use": use_of(name),
        })
    };
    names.iter().map(counted).collect()
}

/// Names of the frames and masks of a scene, in their order.
pub fn frames(work: &Work) -> Value {
    let names = |folder: &str| -> Vec<String> {
        let folder = format!("{}/{folder}", work.scene());
        files(work, &folder).into_iter().filter_map(|f| Some(f["name"].as_str()?.to_owned())).collect()
    };
    json!({ "frames": names("rgbs"), "masks": names("masks") })
}

/// The latest job of the work: this server's, or of one before it.
fn job(studio: &Studio, work: &Work) -> Value {
    let own = studio.jobs.latest().filter(|job| job.work == work.scene());
    let latest = own.as_ref().map(|job| job.step.to_owned()).or_else(|| latest_log(work));
    let Some(step) = latest else { return Value::Null };
    let path = work.project.find(&work.beside(&format!("logs/{step}.txt")));
    let Some(mut news) = path.and_then(|path| log::read(&path)) else { return Value::Null };
    let running = own.as_ref().is_some_and(|job| job.is_running());
    let mut orphan = false;
    if own.is_none() && news.ended.is_none() {
        // The server that started it is gone; the command may live on.
        orphan = is_being_written(work);
        if !orphan {
            news.ended = Some("stopped");
        }
    }
    let News { command, text, progress, fraction, live, ended, error } = news;
    json!({
        "step": step, "running": running || orphan, "orphan": orphan, "command": command, "text": text,
        "progress": progress, "fraction": fraction, "live": live, "ended": ended, "error": error,
    })
}

/// What the latest check said, with the commands before it.
fn findings(work: &Work) -> Option<String> {
    let path = |step: &str| work.beside(&format!("logs/{step}.txt"));
    let latest = ["prepare", "masks"].into_iter().map(path).max_by_key(|name| version(work, name))?;
    log::read(&work.project.find(&latest)?).map(|news| news.text)
}

fn latest_log(work: &Work) -> Option<String> {
    let logs = work.project.find(&work.beside("logs"))?.read_dir().ok()?;
    let dated = logs
        .flatten()
        .filter_map(|e| Some((e.metadata().ok()?.modified().ok()?, e.file_name().into_string().ok()?)));
    let (_, name) = dated.filter(|(_, name)| name.ends_with(".txt")).max()?;
    Some(name.trim_end_matches(".txt").to_owned())
}

/// Whether a command holds the folder that will become the scene or the result.
fn is_being_written(work: &Work) -> bool {
    let names = [work.scene().to_owned(), work.result()].map(|name| format!("{name}.partial"));
    names.iter().filter_map(|name| work.project.find(name)).any(|folder| is_locked(&folder))
}

fn is_locked(folder: &Path) -> bool {
    let file = std::fs::File::open(folder);
    file.is_ok_and(|file| matches!(file.try_lock_shared(), Err(std::fs::TryLockError::WouldBlock)))
}
