//! Writes the seeds of every target into corpus/.

fn main() {
    for (name, _) in tessuto_fuzz::readers::READERS {
        let folder = std::path::Path::new("corpus").join(name);
        std::fs::create_dir_all(&folder).expect("a folder");
        for (k, seed) in tessuto_fuzz::seeds::seeds(name).iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{k}")), seed).expect("a file");
        }
    }
}
