use lloydar::geometry::*;
use lloydar::lloyd::*;
fn rnd(s: &mut u64) -> f64 {
    *s = s.wrapping_add(0x9e3779b97f4a7c15);
    let mut z = *s;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 53) as f64
}
fn report(name: &str, s: &[Site], d: &DistanceSums, h: f64) {
    let c: Vec<&Site> = s.iter().filter(|s| s.is_closed && !s.is_held).collect();
    let n = c.len() as f64;
    let a: f64 = c.iter().map(|s| s.area).sum();
    let e: f64 = c.iter().map(|s| s.energy).sum();
    let m = a / n;
    let cv = (c.iter().map(|s| (s.area - m).powi(2)).sum::<f64>() / n).sqrt() / m;
    let six = c.iter().filter(|s| s.neighbors == 6).count() as f64 / n;
    let hh = (2.0 * m / 3f64.sqrt()).sqrt();
    println!(
        "{name}: n {} closed {} held {} exact {} energy {:.4} cv {:.4} delta {:.4} packing {:.4} six {:.3} hhex/h {:.4}",
        s.len(),
        c.len(),
        s.iter().filter(|s| s.is_held).count(),
        s.iter().filter(|s| s.is_exact).count(),
        e / a * n / a / 0.160375,
        cv,
        d.delta(),
        d.sum / d.count as f64 / hh,
        six,
        hh / h
    );
}
fn main() {
    let mut s = 1u64;
    let which = std::env::args().nth(1).unwrap_or("sphere".into());
    let n = 300_000;
    let lat = Lattice {
        scale: 1e-6,
        offset: [0.0; 3],
    };
    let (pts, h): (Vec<[f64; 3]>, f64) = match which.as_str() {
        "sphere" => (
            (0..n)
                .map(|_| {
                    let z = 2.0 * rnd(&mut s) - 1.0;
                    let t = 6.283185307179586 * rnd(&mut s);
                    let r = (1.0 - z * z).sqrt();
                    [r * t.cos(), r * t.sin(), z]
                })
                .collect(),
            (2.0 * 4.0 * std::f64::consts::PI / 10_000.0 / 3f64.sqrt()).sqrt(),
        ),
        _ => (
            (0..400_000)
                .map(|_| {
                    let x = rnd(&mut s) * 2.0;
                    let y = rnd(&mut s) * 2.0;
                    [x, y, 0.1 * (5.0 * x).sin() * (4.0 * y).cos()]
                })
                .collect(),
            (2.0 * 4.3 / 20_000.0 / 3f64.sqrt()).sqrt(),
        ),
    };
    let pts: Vec<Stored> = pts.into_iter().map(|p| lat.quantise(p).unwrap()).collect();
    for acc in [
        Acceleration::None,
        Acceleration::Relaxation,
        Acceleration::Anderson,
        Acceleration::AndersonGlobal,
    ] {
        let o = Options {
            acceleration: acc,
            ..Options::new(h)
        };
        let t = std::time::Instant::now();
        let scan = Scan::new(pts.clone(), lat, h, o.fit_radius, 0);
        let t1 = t.elapsed();
        let sol = solve(&scan, &Domain::everything(), &o);
        let el = t.elapsed();
        if acc == Acceleration::None {
            report("seeds", &sol.seeds, &sol.convergence[0], h);
        }
        report(
            &format!(
                "{acc:?} {:.2}s+{:.2}s",
                t1.as_secs_f64(),
                (el - t1).as_secs_f64()
            ),
            &sol.sites,
            sol.convergence.last().unwrap(),
            h,
        );
        println!(
            "   {:?}",
            sol.convergence
                .iter()
                .map(|d| (d.delta() * 1e4).round() / 1e4)
                .collect::<Vec<_>>()
        );
    }
}
