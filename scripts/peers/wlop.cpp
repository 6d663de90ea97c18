// Runs CGAL's weighted locally optimal projection (WLOP) with its defaults. Reads a file of
// doubles (x y z x y z …) and writes another.
//
//     wlop IN OUT COUNT

#include <CGAL/Simple_cartesian.h>
#include <CGAL/wlop_simplify_and_regularize_point_set.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <vector>

#include "points.hpp"

using Point = CGAL::Simple_cartesian<double>::Point_3;

int main(int count, char **arguments) {
  if (count != 4) {
    std::fprintf(stderr, "wlop IN OUT COUNT\n");
    return 2;
  }
  std::vector<Point> points = read_points<Point>(arguments[1]);

  std::vector<Point> kept;
  const double share = 100.0 * std::atof(arguments[3]) / points.size();
  CGAL::wlop_simplify_and_regularize_point_set<CGAL::Parallel_if_available_tag>(
      points, std::back_inserter(kept), CGAL::parameters::select_percentage(share));

  std::ofstream out(arguments[2], std::ios::binary);
  for (const Point &point : kept) {
    const double xyz[3] = {point.x(), point.y(), point.z()};
    out.write(reinterpret_cast<const char *>(xyz), sizeof xyz);
  }
  return out ? 0 : 1;
}
