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

fn entry(cache: &Cache, number: u32) -> Entry<'_> {
    cache.entry("test", |key| {
        key.numbers("number", &[number]);
    })
}

fn kept(cache: &Cache, number: u32) -> Option<Vec<f32>> {
    entry(cache, number).read()
}

fn keep(cache: &Cache, number: u32, values: &Vec<f32>) {
    entry(cache, number).keep(Instant::now(), values);
    assert_eq!(cache.finish(), None);
}

/// The only result in a folder.
fn only_file(folder: &Path) -> std::path::PathBuf {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some_and(|ending| ending == "kept")).collect();
    assert_eq!(files.len(), 1);
    files.remove(0)
}

#[test]
fn what_is_kept_comes_back_bit_for_bit_and_only_under_its_own_key() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(&folder.path().join("deep/er"), MEBIBYTE);
    let values = vec![0.0, -0.0, f32::MIN_POSITIVE / 2.0, f32::from_bits(0x7fc0_1234), f32::NEG_INFINITY];
    assert_eq!(kept(&cache, 1), None);
    keep(&cache, 1, &values);
    let bits = |values: &[f32]| -> Vec<u32> { values.iter().map(|value| value.to_bits()).collect() };
    assert_eq!(bits(&kept(&cache, 1).unwrap()), bits(&values));
    assert_eq!(kept(&cache, 2), None);
    let other_stage = cache.entry("other", |key| {
        key.numbers("number", &[1_u32]);
    });
    assert_eq!(other_stage.read::<Vec<f32>>(), None);
    let other_build = Build::of_this_program().unwrap().of_another_version();
    assert_eq!(kept(&Cache::of(other_build, folder.path(), MEBIBYTE, Duration::ZERO), 1), None);
    assert_eq!(cache.usage().files, 1);
}

#[test]
fn without_a_cache_nothing_is_written_and_nothing_found() {
    let cache = Cache::off();
    keep(&cache, 1, &vec![1.0]);
    assert_eq!(kept(&cache, 1), None);
    assert_eq!((cache.folder(), cache.usage(), cache.clear()), (None, Usage::default(), Usage::default()));
}

#[test]
fn what_is_made_soon_is_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let build = Build::of_this_program().unwrap();
    let cache = Cache::of(build, folder.path(), MEBIBYTE, Duration::from_secs(3600));
    keep(&cache, 1, &vec![1.0]);
    assert_eq!(cache.usage(), Usage::default());
}

#[test]
fn a_file_that_was_cut_or_changed_anywhere_is_removed_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    let values: Vec<f32> = (0..20).map(|k| k as f32).collect();
    keep(&cache, 1, &values);
    let path = only_file(folder.path());
    let whole = fs::read(&path).unwrap();
    let damage = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        assert_eq!(kept(&cache, 1), None, "{} bytes", bytes.len());
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
    keep(&cache, 1, &values);
    assert_eq!(fs::read(&path).unwrap(), whole);
    assert_eq!(kept(&cache, 1), Some(values));
}

#[test]
fn a_sound_file_under_another_name_or_of_another_shape_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    keep(&cache, 1, &vec![1.0]);
    let first = only_file(folder.path());
    let moved = folder.path().join("moved");
    fs::rename(&first, &moved).unwrap();
    keep(&cache, 2, &vec![2.0]);
    let second = only_file(folder.path());
    fs::rename(&moved, &second).unwrap();
    assert_eq!(kept(&cache, 2), None);
    assert!(!second.exists());
    // The checksum is right, and what it is of is no list of numbers.
    let key = KeyBuilder::new("test", &Build::of_this_program().unwrap()).numbers("number", &[3_u32]).finish();
    Store::new(folder.path().to_owned(), MEBIBYTE).write(&key, &[255; 11]).unwrap();
    assert_eq!(kept(&cache, 3), None);
    assert_eq!(cache.usage(), Usage::default());
}

#[test]
fn the_least_recently_used_go_first_and_the_sum_stays_within_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 10_000);
    let values = vec![0.5_f32; 400];
    let long_ago = SystemTime::now() - Duration::from_secs(1000);
    for number in 0..5 {
        keep(&cache, number, &values);
        // Reading is use.
        for entry in fs::read_dir(folder.path()).unwrap() {
            let file = fs::OpenOptions::new().append(true).open(entry.unwrap().path()).unwrap();
            if file.metadata().unwrap().modified().unwrap() > long_ago + Duration::from_secs(100) {
                file.set_modified(long_ago + Duration::from_secs(u64::from(number))).unwrap();
            }
        }
    }
    assert!(cache.usage().bytes <= 10_000 && cache.usage().files == 5, "{:?}", cache.usage());
    assert!(kept(&cache, 0).is_some() && kept(&cache, 2).is_some());
    for number in 5..7 {
        keep(&cache, number, &values);
        assert!(cache.usage().bytes <= 10_000, "{:?}", cache.usage());
    }
    let left: Vec<u32> = (0..7).filter(|&number| kept(&cache, number).is_some()).collect();
    assert_eq!(left, [0, 2, 4, 5, 6]);
}

#[test]
fn what_is_larger_than_its_share_is_not_kept() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), 10_000);
    keep(&cache, 1, &vec![0.5; 400]);
    keep(&cache, 2, &vec![0.5; 700]);
    assert!(kept(&cache, 1).is_some() && kept(&cache, 2).is_none());
}

#[test]
fn files_of_others_are_neither_counted_nor_removed_and_what_was_abandoned_goes() {
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
    keep(&cache, 1, &vec![1.0]);
    assert!(kept(&cache, 1).is_some() && !abandoned.exists() && being_written.exists());
    assert_eq!(cache.clear().files, 2);
    assert_eq!(cache.usage(), Usage::default());
    assert!(foreign.iter().all(|path| path.exists()));
}

#[test]
fn threads_and_caches_that_write_and_read_one_key_meet_whole_results_only() {
    let folder = tempfile::tempdir().unwrap();
    let values: Vec<f32> = (0..20_000).map(|k| (k as f32).sqrt()).collect();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                // As another process would: nothing is shared but the folder.
                let cache = Cache::of_everything(folder.path(), MEBIBYTE);
                for round in 0..30 {
                    if let Some(found) = kept(&cache, 1) {
                        assert!(found == values);
                    }
                    entry(&cache, 1).keep(Instant::now(), &values);
                    if round % 10 == 0 {
                        cache.clear();
                    }
                }
                cache.finish();
            });
        }
    });
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    assert!(kept(&cache, 1).is_none_or(|found| found == values));
    assert!(cache.usage().files <= 1, "{:?}", cache.usage());
}

#[test]
fn a_folder_that_goes_away_is_made_again() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("cache");
    let cache = Cache::of_everything(&folder, MEBIBYTE);
    keep(&cache, 1, &vec![1.0]);
    assert!(folder.join("CACHEDIR.TAG").exists());
    fs::remove_dir_all(&folder).unwrap();
    assert_eq!(kept(&cache, 1), None);
    keep(&cache, 1, &vec![1.0]);
    assert_eq!(kept(&cache, 1), Some(vec![1.0]));
}

#[test]
fn a_place_that_cannot_be_written_is_told_once_and_is_no_error() {
    let outer = tempfile::tempdir().unwrap();
    let file = outer.path().join("file");
    fs::write(&file, "no folder").unwrap();
    let cache = Cache::of_everything(&file.join("cache"), MEBIBYTE);
    for number in 0..3 {
        entry(&cache, number).keep(Instant::now(), &vec![1.0]);
        assert_eq!(kept(&cache, number), None);
    }
    assert!(cache.finish().unwrap().contains("cache"));
    assert_eq!(fs::read(&file).unwrap(), b"no folder");
}

#[cfg(unix)]
#[test]
fn what_can_only_be_read_is_read() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MEBIBYTE);
    keep(&cache, 1, &vec![1.0]);
    fs::set_permissions(only_file(folder.path()), fs::Permissions::from_mode(0o444)).unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).unwrap();
    assert_eq!(kept(&cache, 1), Some(vec![1.0]));
    entry(&cache, 2).keep(Instant::now(), &vec![2.0]);
    let told = cache.finish();
    // Who may do everything is not refused.
    assert_eq!(told.is_none(), kept(&cache, 2).is_some());
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
#[ignore = "prints what it costs: cargo test --release --lib costs_of_keeping -- --ignored --nocapture"]
fn costs_of_keeping() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::of_everything(folder.path(), MAX);
    let values: Vec<f32> = (0..1 << 20).map(|k| (k as f32).sqrt()).collect();
    let ms = |start: Instant| start.elapsed().as_secs_f64() * 1e3;
    println!("4 MiB, ms:  key    keep    write behind    read");
    for number in 0..5_u32 {
        let start = Instant::now();
        let entry = cache.entry("costs", |key| {
            key.numbers("input", &values).numbers("number", &[number]);
        });
        let keyed = ms(start);
        let start = Instant::now();
        entry.keep(start, &values);
        let handed = ms(start);
        cache.finish();
        let written = ms(start);
        let start = Instant::now();
        assert_eq!(entry.read::<Vec<f32>>().map(|read| read.len()), Some(values.len()));
        println!("{keyed:16.2} {handed:7.2} {written:15.2} {:7.2}", ms(start));
    }
}
