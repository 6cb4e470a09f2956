use super::*;

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn the_temporary_file_is_opened_by_the_first_bytes_and_never_after_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    crate::base::check_output(&path, &[]).unwrap();
    let bytes = vec![7; 2 * BYTES_PER_STEP];
    write_atomically(&path, |out| {
        assert!(names(folder.path()).is_empty(), "nothing is written yet");
        out.write_all(&bytes)?;
        assert_eq!(names(folder.path()).len(), 1);
        Ok(())
    })
    .unwrap();
    assert_eq!(names(folder.path()), ["a.npz"]);
    for count in [1, bytes.len()] {
        write_atomically::<()>(&path, |out| {
            out.write_all(&bytes[..count])?;
            Err(io::Error::other("a fault"))
        })
        .unwrap_err();
        assert_eq!((names(folder.path()), fs::read(&path).unwrap().len()), (vec!["a.npz".to_owned()], bytes.len()));
    }
    write_atomically(&path, |_| Ok(())).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"", "an empty content empties the file");
}

#[test]
fn a_write_removes_temporary_files_of_ended_processes_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let [path, abandoned, used] = ["a.csv", ".a.csv.12-0.part", ".a.csv.1-3.part"].map(|name| folder.path().join(name));
    let others = [".a.csv.12-0.part.bak", ".a.csv.part", ".a.csv.x-0.part", ".b.csv.12-0.part"];
    for other in others {
        fs::write(folder.path().join(other), "someone else's").unwrap();
    }
    fs::write(&abandoned, "half").unwrap();
    // A process that runs holds the lock of its file.
    let lock = File::create(&used).unwrap();
    lock.try_lock().unwrap();
    replace_file(&path, b"all").unwrap();
    let mut expected: Vec<&str> = others.into_iter().chain([".a.csv.1-3.part", "a.csv"]).collect();
    expected.sort_unstable();
    assert_eq!(names(folder.path()), expected);
    drop(lock);
    replace_file(&path, b"all").unwrap();
    assert!(!used.exists() && fs::read(&path).unwrap() == b"all");
}

#[test]
fn names_of_255_bytes_are_written() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["x".repeat(251), "é".repeat(125) + "x"] {
        let path = folder.path().join(name + ".png");
        replace_file(&path, b"content").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"content");
    }
    assert_eq!(names(folder.path()).len(), 2);
}
