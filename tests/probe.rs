use biscale::accuracy::*; use biscale::brdf::*; use biscale::directions::*; use biscale::filtering::*; use biscale::geometry::*; use biscale::visibility::*;
use glam::*; use std::sync::Arc; use std::time::Instant;
fn heightfield(n: usize, h: impl Fn(f32,f32)->f32) -> TileMesh {
    let mut m = TileMesh{size: Vec2::ONE, slots: vec!["surface".into()], ..Default::default()};
    for j in 0..n { for i in 0..n { let (x,y)=((i as f32+0.5)/n as f32,(j as f32+0.5)/n as f32); m.positions.push(vec3(x,y,h(x,y))); } }
    // wrapped: duplicate last row/col
    let mut id = |i: usize, j: usize, m: &mut TileMesh| -> u32 { if i<n && j<n { (j*n+i) as u32 } else { let mut p = m.positions[(j%n)*n+i%n]; if i>=n {p.x+=1.0;} if j>=n {p.y+=1.0;} m.positions.push(p); (m.positions.len()-1) as u32 } };
    m.height_grid = Some(HeightGrid{size: UVec2::splat(n as u32), heights: m.positions.iter().map(|p| p.z).collect()});
    for j in 0..n { for i in 0..n { let a=id(i,j,&mut m); let b=id(i+1,j,&mut m); let c=id(i+1,j+1,&mut m); let d=id(i,j+1,&mut m); m.triangles.push([a,b,c]); m.triangles.push([a,c,d]); m.triangle_slot.extend([0,0]); } }
    m
}
fn groove() -> TileMesh { // V groove, 45 deg x2
    let mut m = TileMesh{size: Vec2::ONE, slots: vec!["surface".into()], ..Default::default()};
    m.positions = vec![vec3(0.,0.,0.),vec3(0.5,0.,-0.4),vec3(1.,0.,0.),vec3(0.,1.,0.),vec3(0.5,1.,-0.4),vec3(1.,1.,0.)];
    m.triangles = vec![[0,1,4],[0,4,3],[1,2,5],[1,5,4]]; m.triangle_slot=vec![0;4]; m
}
fn rods() -> TileMesh { // floor + leaning prisms, overhang
    let mut m = TileMesh{size: Vec2::ONE, slots: vec!["surface".into()], ..Default::default()};
    m.positions = vec![vec3(0.,0.,0.),vec3(1.,0.,0.),vec3(1.,1.,0.),vec3(0.,1.,0.)];
    m.triangles = vec![[0,1,2],[0,2,3]]; 
    for k in 0..16 { let c = vec2((k%4) as f32*0.25+0.1+0.03*(k as f32).sin(), (k/4) as f32*0.25+0.1+0.03*(k as f32*1.7).cos()); let lean = vec2((k as f32*2.3).sin()*0.2+0.1,(k as f32*1.1).cos()*0.2); let r=0.05; let s=8; let base=m.positions.len() as u32;
        for q in 0..s { let a=q as f32/s as f32*6.2831853; let d=vec2(a.cos(),a.sin())*r; m.positions.push((c+d).extend(-0.01)); m.positions.push((c+lean+d*0.7).extend(0.5)); }
        m.positions.push((c+lean).extend(0.5)); let top=m.positions.len() as u32-1;
        for q in 0..s { let (a,b)=(base+2*q as u32, base+2*((q+1)%s) as u32); m.triangles.push([a,b,b+1]); m.triangles.push([a,b+1,a+1]); m.triangles.push([a+1,b+1,top]); } }
    m.triangle_slot = vec![0; m.triangles.len()]; m
}
fn tiles() -> Vec<(&'static str, TileMesh)> { 
    use std::f32::consts::TAU;
    vec![("egg", heightfield(64, |x,y| 0.12*((TAU*2.0*x).sin()*(TAU*2.0*y).cos()))),
    ("noise", heightfield(128, |x,y| 0.08*((TAU*x+1.0).sin()*(TAU*2.0*y).cos()+0.5*(TAU*3.0*(x+y)).sin()+0.4*(TAU*(5.0*x-4.0*y)).cos()))),
    ("groove", groove()), ("rods", rods())] }
fn brdfs() -> Vec<(&'static str, Term)> { let w=Vec3::ONE; vec![("lambert",Term::Lambertian{albedo:w}),("ct.2",Term::CookTorrance{roughness:0.2,f0:w*0.8}),("ct.5",Term::CookTorrance{roughness:0.5,f0:w*0.8}),("ward.3",Term::Ward{roughness:0.3,specular:w}),("bp50",Term::BlinnPhong{exponent:50.,specular:w})] }
#[test] fn direct_against_reference() {
    let pairs = mirror_biased_pairs(300, 7);
    for (tn, mesh) in tiles() { if tn=="groove" {continue}
        let materials = |t: &Term| vec![SumMaterial{brdf: Brdf{terms: vec![t.clone()]}, color: Vec3::ONE}];
        let grid = PeriodicGrid::new(&mesh);
        for (bn, term) in brdfs() {
            if std::env::var("BRDF").is_ok_and(|b| !b.split(',').any(|b| b==bn)) {continue}
            let t=Instant::now();
            let rf = Reference::new(&mesh, &[0], &materials(&term)).estimate(&pairs, &ReferenceSettings{facets: 4096, max_passes: 8, seed: 5, ..Default::default()}, |_,_| true);
            let t_ref=t.elapsed();
            let se = (rf.iter().map(|e| e.standard_error.as_dvec3().length_squared()).sum::<f64>()/rf.iter().map(|e| e.f_bar.as_dvec3().length_squared()).sum::<f64>()).sqrt();
            let rv: Vec<Vec3> = rf.iter().map(|e| e.f_bar).collect();
            let mut line = format!("{tn:7} {bn:8} ref {:.1}s se {:.2}%", t_ref.as_secs_f64(), 100.*se);
            for (n, az) in [(2000,48),(4000,48),(8000,48)] {
                let t=Instant::now();
                let mut f = Facets::sample(&mesh, n, 0); f.sort_for_sums();
                let overhang = (0..mesh.triangles.len()).any(|t| mesh.geometric_normal(t).z < -1e-6) ;
                let h = if overhang { Visibility::Maps(SoftMaps::scan(&grid, &f, PolarGrid::new(az/2, az))) } else if let Some(g)=&mesh.height_grid { Visibility::Horizons(Horizons::march(g, mesh.size, &f, az, 0.02)) } else { Visibility::Horizons(Horizons::scan(&grid, &f, az, 0.02)) };
                let t_h=t.elapsed();
                let d = EffectiveBrdf{form: Form::Direct(Direct{sum: Arc::new(FacetSum::new(&f,&[0],&materials(&term))), visibility: Arc::new(h)}), base_area: 1.0};
                let t=Instant::now();
                let v: Vec<Vec3> = pairs.iter().map(|p| d.eval(p.i,p.o)).collect();
                let e=compare(&v,&rv);
                line += &format!(" | {n}/{az} {:.1}dB {:.2}% vis {:.0}ms eval {:.1}us", e.psnr_db, 100.*e.rel_l2, t_h.as_secs_f64()*1e3, t.elapsed().as_secs_f64()*1e6/pairs.len() as f64);
            }
            println!("{line}");
        }
    }
}
#[test] fn speed() {
    let n=8000; let mesh=&tiles()[1].1; let mut f=Facets::sample(mesh,n,0); f.sort_for_sums();
    let v=vec![1.0f32;n]; let i=from_angles(0.5,0.3); let o=from_angles(0.9,2.0);
    for (name,t) in brdfs().into_iter().chain([("ggx",Term::Ggx{roughness:0.2,f0:Vec3::ONE})]) { let s=FacetSum::new(&f,&[0],&[SumMaterial{brdf:Brdf{terms:vec![t]},color:Vec3::ONE}]);
        let mut best=1e9f64; let mut x=DVec3::ZERO; for _ in 0..200 { let t=Instant::now(); x+=s.sum(i,o,&v,&v); best=best.min(t.elapsed().as_secs_f64()); }
        println!("{name}: {:.2} ns/facet {x}", best*1e9/n as f64); }
    let g=PeriodicGrid::new(mesh);
    for (nm,vis) in [("march",Visibility::Horizons(Horizons::march(mesh.height_grid.as_ref().unwrap(),mesh.size,&f,16,0.02))),("maps",Visibility::Maps(SoftMaps::scan(&g,&f,PolarGrid::new(8,16))))] {
        let mut out=vec![0.0f32;n]; let mut best=1e9f64; for k in 0..200 { let t=Instant::now(); vis.fill(from_angles(0.5+k as f32*0.001,0.3),0..n,&mut out); best=best.min(t.elapsed().as_secs_f64()); }
        println!("{nm} fill {:.2} ns/facet", best*1e9/n as f64); }
    let t=Instant::now(); let h=Horizons::march(mesh.height_grid.as_ref().unwrap(),mesh.size,&f,32,0.02); println!("march {:.2} us/scan/2cores", t.elapsed().as_secs_f64()*1e6/(32*n) as f64); drop(h);
    for (tn,mesh) in tiles() { let g=PeriodicGrid::new(&mesh); let mut f=Facets::sample(&mesh,n,0); f.sort_for_sums(); let t=Instant::now(); SoftMaps::scan(&g,&f,PolarGrid::new(16,16)); println!("{tn} scan {:.2} us", t.elapsed().as_secs_f64()*1e6/(16*n) as f64); }
}
#[test] fn lowrank() {
    let pairs = mirror_biased_pairs(400, 7);
    for (tn, mesh) in tiles() {
        if std::env::var("TILE").is_ok_and(|b| b!=tn) {continue}
        let grid = PeriodicGrid::new(&mesh);
        let mut f = Facets::sample(&mesh, 2000, 0); f.sort_for_sums();
        let overhang = !mesh.is_height_field() && tn=="rods";
        let vis = Arc::new(if overhang { Visibility::Maps(SoftMaps::scan(&grid, &f, PolarGrid::new(24, 48))) } else if let Some(g)=&mesh.height_grid { Visibility::Horizons(Horizons::march(g, mesh.size, &f, 48, 0.02)) } else { Visibility::Horizons(Horizons::scan(&grid, &f, 48, 0.02)) });
        for (bn, term) in brdfs() {
            if std::env::var("BRDF").is_ok_and(|b| !b.split(',').any(|b| b==bn)) {continue}
            let materials = vec![SumMaterial{brdf: Brdf{terms: vec![term.clone()]}, color: Vec3::ONE}];
            let d = EffectiveBrdf{form: Form::Direct(Direct{sum: Arc::new(FacetSum::new(&f,&[0],&materials)), visibility: vis.clone()}), base_area: 1.0};
            let rv: Vec<Vec3> = pairs.iter().map(|p| d.eval(p.i,p.o)).collect();
            let mut line = format!("{tn:7} {bn:8}");
            let run = |dirs: (usize,usize), hd: (usize,usize,usize,usize), nr: usize, km: f64, kn: f64, mr: usize| -> String {
                let s = LowRankSettings{directions: PolarGrid::new(dirs.0,dirs.1), basis: BasisGrid{pairs: HalfDifferenceGrid{rings: hd.0, azimuths: hd.1, difference: hd.2, turn: hd.3}, normal_rings: nr, whole_sphere: overhang}, keep_m: km, keep_n: kn, max_rank: mr, colors: None, keep_color: 0.999, seed: 1};
                let t=Instant::now();
                let lr = LowRank::build(&f,&vis,&[0],&materials,&s).unwrap(); let tb=t.elapsed().as_secs_f64();
                let ranks=lr.channels[0].ranks; let mb=lr.bytes()/1000000;
                let e = EffectiveBrdf{form: Form::LowRank(lr), base_area: 1.0};
                let t=Instant::now();
                let v: Vec<Vec3> = pairs.iter().map(|p| e.eval(p.i,p.o)).collect();
                let er=compare(&v,&rv);
                format!(" | {:.1}dB {:.2}% r{:?} {:.2}s {mb}MB q{:.2}us", er.psnr_db, 100.*er.rel_l2, ranks, tb, t.elapsed().as_secs_f64()*1e6/400.)
            };
            if std::env::var("TILE").is_ok_and(|b| b!=tn) {continue}
            for v in [((16,36),(32,64,10,8),64),((16,36),(32,64,20,8),64),((16,36),(32,64,10,16),64),((16,36),(32,64,20,16),64),((16,36),(64,64,10,8),64),((16,36),(32,128,10,8),64),((16,36),(32,64,10,8),128),((32,64),(32,64,10,8),64),((32,64),(48,64,20,16),64)] { println!("{line} {v:?} {}", run(v.0,v.1,v.2,0.9998,0.9998,40)); }
            println!("{line}");
        }
    }
}
