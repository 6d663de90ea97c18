// Runs CGAL's advancing front surface reconstruction with its defaults. Reads a file of
// doubles (x y z x y z …), writes the triangles as 32-bit indices (a b c a b c …), and prints the
// seconds that the reconstruction took.
//
//     front IN OUT

#include <CGAL/Advancing_front_surface_reconstruction.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

#include "points.hpp"

using Point = CGAL::Exact_predicates_inexact_constructions_kernel::Point_3;

int main(int count, char **arguments) {
  if (count != 3) {
    std::fprintf(stderr, "front IN OUT\n");
    return 2;
  }
  std::vector<Point> points = read_points<Point>(arguments[1]);

  const auto begun = std::chrono::steady_clock::now();
  std::vector<std::array<std::size_t, 3>> triangles;
  CGAL::advancing_front_surface_reconstruction(points.begin(), points.end(),
                                               std::back_inserter(triangles));
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begun;
  std::printf("%.2f\n", taken.count());

  std::ofstream out(arguments[2], std::ios::binary);
  for (const auto &corners : triangles)
    for (const std::size_t corner : corners) {
      const auto index = static_cast<std::uint32_t>(corner);
      out.write(reinterpret_cast<const char *>(&index), sizeof index);
    }
  return out ? 0 : 1;
}
