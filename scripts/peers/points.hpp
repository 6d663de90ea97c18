// Reads a file of doubles (x y z x y z …).

#pragma once

#include <fstream>
#include <vector>

template <class Point> std::vector<Point> read_points(const char *path) {
  std::ifstream in(path, std::ios::binary);
  std::vector<Point> points;
  double place[3];
  while (in.read(reinterpret_cast<char *>(place), sizeof place))
    points.emplace_back(place[0], place[1], place[2]);
  return points;
}
