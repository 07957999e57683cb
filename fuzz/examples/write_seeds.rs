//! Writes the seeds of every target into corpus/.

fn main() {
    for (name, _) in tessuto_fuzz::readers::READERS {
        let folder = std::path::Path::new("corpus").join(name);
        std::fs::create_dir_all(&folder).expect("a folder");
        for (k, seed) in tessuto_fuzz::seeds::seeds(name).iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{k}")), seed).expect("a file");
        }
    }
    // Films are made by ffmpeg.
    let folder = tempfile::tempdir().expect("a folder");
    for (name, film, _) in tessuto_fuzz::damage::seeds(folder.path()) {
        let target = match name.rsplit_once('.') {
            Some((_, "mkv")) => "matroska",
            Some((_, "h264" | "hevc")) => "annexb",
            _ => "mp4",
        };
        let folder = std::path::Path::new("corpus").join(target);
        std::fs::create_dir_all(&folder).expect("a folder");
        std::fs::write(folder.join(name), film).expect("a file");
    }
}
