use std::fs;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};

use super::store::Store;
use super::*;

impl Stored for Vec<f32> {
    fn write(&self, out: &mut Writer) {
        out.numbers(self);
    }
    fn read(from: &mut Reader<'_>) -> Option<Self> {
        from.numbers()
    }
}

const MEBIBYTE: u64 = 1 << 20;

fn key(stage: &str, build: &Build, number: u32) -> Key {
    KeyBuilder::new(stage, build).numbers("number", &[number]).finish()
}

fn entry(cache: &Cache, number: u32) -> Entry<'_> {
    cache.entry_of(key("test", &Build::of_this_program(), number))
}

fn cached(cache: &Cache, number: u32) -> Option<Vec<f32>> {
    entry(cache, number).read(Vec::read)
}

fn store(cache: &Cache, number: u32, values: &Vec<f32>) {
    entry(cache, number).store(Instant::now(), values, Vec::write);
    assert_eq!(cache.finish(), None);
}

/// Path of the only result in a folder.
fn only_file(folder: &Path) -> std::path::PathBuf {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some_and(|ending| ending == "kept")).collect();
    assert_eq!(files.len(), 1);
    files.remove(0)
}

#[test]
fn a_result_is_read_bit_for_bit_and_only_under_its_own_key() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(&folder.path().join("deep/er"), MEBIBYTE);
    let values = vec![0.0, -0.0, f32::MIN_POSITIVE / 2.0, f32::from_bits(0x7fc0_1234), f32::NEG_INFINITY];
    assert_eq!(cached(&cache, 1), None);
    store(&cache, 1, &values);
    let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|value| value.to_bits()).collect() };
    assert_eq!(bits(&cached(&cache, 1).unwrap()), bits(&values));
    assert_eq!(cached(&cache, 2), None);
    let build = Build::of_this_program();
    for other in [key("other", &build, 1), key("test", &build.of_another_version(), 1)] {
        assert_eq!(cache.entry_of(other).read(Vec::<f32>::read), None);
    }
    assert_eq!(cache.usage().files, 1);
}

#[test]
fn without_a_cache_nothing_is_written_or_found() {
    let cache = Cache::off();
    store(&cache, 1, &vec![1.0]);
    assert_eq!(cached(&cache, 1), None);
    assert_eq!((cache.folder(), cache.usage(), cache.clear()), (None, Usage::default(), Usage::default()));
}

#[test]
fn results_of_short_computations_are_not_cached() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of(folder.path(), MEBIBYTE, Duration::from_secs(3600));
    store(&cache, 1, &vec![1.0]);
    assert_eq!(cache.usage(), Usage::default());
}

#[test]
fn a_truncated_or_changed_file_is_removed_and_written_again() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    let values: Vec<f32> = (0..20).map(|k| k as f32).collect();
    store(&cache, 1, &values);
    let path = only_file(folder.path());
    let whole = fs::read(&path).unwrap();
    let damage = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        assert_eq!(cached(&cache, 1), None, "{} bytes", bytes.len());
        assert!(!path.exists());
    };
    for at in 0..whole.len() {
        damage(&whole[..at]);
        let mut flipped = whole.clone();
        flipped[at] ^= 1 << (at % 8);
        damage(&flipped);
    }
    damage(&[&whole[..], &[0]].concat());
    damage(b"what somebody else wrote");
    store(&cache, 1, &values);
    assert_eq!(fs::read(&path).unwrap(), whole);
    assert_eq!(cached(&cache, 1), Some(values));
}

#[test]
fn a_sound_file_with_another_name_or_another_type_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    store(&cache, 1, &vec![1.0]);
    let first = only_file(folder.path());
    let moved = folder.path().join("moved");
    fs::rename(&first, &moved).unwrap();
    store(&cache, 2, &vec![2.0]);
    let second = only_file(folder.path());
    fs::rename(&moved, &second).unwrap();
    assert_eq!(cached(&cache, 2), None);
    assert!(!second.exists());
    // The checksum is correct, but the payload is no list of numbers.
    let key = KeyBuilder::new("test", &Build::of_this_program()).numbers("number", &[3_u32]).finish();
    Store::new(folder.path().to_owned(), MEBIBYTE).write(&key, &[255; 11]).unwrap();
    assert_eq!(cached(&cache, 3), None);
    assert_eq!(cache.usage(), Usage::default());
}

#[test]
fn the_least_recently_used_files_are_removed_first_and_the_total_stays_within_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 10_000);
    let values = vec![0.5_f32; 400];
    let long_ago = SystemTime::now() - Duration::from_secs(1000);
    for number in 0..5 {
        store(&cache, number, &values);
        // Reading a file updates its time.
        for entry in fs::read_dir(folder.path()).unwrap() {
            let file = fs::OpenOptions::new().append(true).open(entry.unwrap().path()).unwrap();
            if file.metadata().unwrap().modified().unwrap() > long_ago + Duration::from_secs(100) {
                file.set_modified(long_ago + Duration::from_secs(u64::from(number))).unwrap();
            }
        }
    }
    assert!(cache.usage().bytes <= 10_000 && cache.usage().files == 5, "{:?}", cache.usage());
    assert!(cached(&cache, 0).is_some() && cached(&cache, 2).is_some());
    for number in 5..7 {
        store(&cache, number, &values);
        assert!(cache.usage().bytes <= 10_000, "{:?}", cache.usage());
    }
    let left: Vec<u32> = (0..7).filter(|&number| cached(&cache, number).is_some()).collect();
    assert_eq!(left, [0, 2, 4, 5, 6]);
}

#[test]
fn a_result_larger_than_its_share_is_not_cached() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 10_000);
    store(&cache, 1, &vec![0.5; 400]);
    store(&cache, 2, &vec![0.5; 700]);
    assert!(cached(&cache, 1).is_some() && cached(&cache, 2).is_none());
}

#[test]
fn other_files_are_neither_counted_nor_removed_and_abandoned_files_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 2000);
    let old = SystemTime::now() - Duration::from_secs(100_000);
    let write = |name: &str, bytes: usize| {
        let path = folder.path().join(name);
        fs::write(&path, vec![0_u8; bytes]).unwrap();
        fs::OpenOptions::new().append(true).open(&path).unwrap().set_modified(old).unwrap();
        path
    };
    let foreign =
        [write("letter.txt", 5000), write("abc.kept", 5000), write(&format!("{}.kept2", "a".repeat(64)), 5000)];
    let abandoned = write(&format!("{}-77-0.part", "a".repeat(64)), 100);
    let being_written = folder.path().join(format!("{}-78-0.part", "b".repeat(64)));
    fs::write(&being_written, [0; 100]).unwrap();
    store(&cache, 1, &vec![1.0]);
    assert!(cached(&cache, 1).is_some() && !abandoned.exists() && being_written.exists());
    assert_eq!(cache.clear().files, 2);
    assert_eq!(cache.usage(), Usage::default());
    assert!(foreign.iter().all(|path| path.exists()));
}

#[test]
fn concurrent_threads_and_caches_read_complete_results_only() {
    let folder = tempfile::tempdir().unwrap();
    let values: Vec<f32> = (0..20_000).map(|k| (k as f32).sqrt()).collect();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                // Like another process, this cache shares only the folder.
                let cache = Cache::of_everything(folder.path(), MEBIBYTE);
                for round in 0..30 {
                    if let Some(found) = cached(&cache, 1) {
                        assert!(found == values);
                    }
                    entry(&cache, 1).store(Instant::now(), &values, Vec::write);
                    if round % 10 == 0 {
                        cache.clear();
                    }
                }
                cache.finish();
            });
        }
    });
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    assert!(cached(&cache, 1).is_none_or(|found| found == values));
    assert!(cache.usage().files <= 1, "{:?}", cache.usage());
}

#[test]
fn a_removed_folder_is_created_again() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("cache");
    let cache = Cache::of_everything(&folder, MEBIBYTE);
    store(&cache, 1, &vec![1.0]);
    assert!(folder.join("CACHEDIR.TAG").exists());
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(cached(&cache, 1), None);
    store(&cache, 1, &vec![1.0]);
    assert_eq!(cached(&cache, 1), Some(vec![1.0]));
}

#[test]
fn a_folder_that_cannot_be_written_is_reported_by_finish_and_changes_nothing() {
    let outer = tempfile::tempdir().unwrap();
    let file = outer.path().join("file");
    fs::write(&file, "no folder").unwrap();
    let cache = Cache::of_everything(&file.join("cache"), MEBIBYTE);
    for number in 0..3 {
        entry(&cache, number).store(Instant::now(), &vec![1.0], Vec::write);
        assert_eq!(cached(&cache, number), None);
    }
    assert!(cache.finish().unwrap().contains("cache"));
    assert_eq!(fs::read(&file).unwrap(), b"no folder");
}

#[cfg(unix)]
#[test]
fn a_read_only_file_is_read() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    store(&cache, 1, &vec![1.0]);
    fs::set_permissions(only_file(folder.path()), fs::Permissions::from_mode(0o444)).unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
    assert_eq!(cached(&cache, 1), Some(vec![1.0]));
    entry(&cache, 2).store(Instant::now(), &vec![2.0], Vec::write);
    let error = cache.finish();
    // The superuser may write in spite of the permissions.
    assert_eq!(error.is_none(), cached(&cache, 2).is_some());
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
#[ignore = "a measurement: cargo bench --bench measure -- cache-costs"]
fn costs_of_caching() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MAX_BYTES);
    let values: Vec<f32> = (0..1 << 20).map(|k| (k as f32).sqrt()).collect();
    let ms = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
    println!("4 MiB, ms:  key   store    written in      read");
    for number in 0..5_u32 {
        let start = Instant::now();
        let mut key = KeyBuilder::of_stage("costs");
        let entry = cache.entry_of(key.numbers("input", &values).numbers("number", &[number]).finish());
        let keyed = ms(start);
        let start = Instant::now();
        entry.store(start, &values, Vec::write);
        let submitted = ms(start);
        cache.finish();
        let written = ms(start);
        let start = Instant::now();
        assert_eq!(entry.read(Vec::<f32>::read).map(|read| read.len()), Some(values.len()));
        println!("{keyed:16.2} {submitted:7.2} {written:15.2} {:7.2}", ms(start));
    }
}
