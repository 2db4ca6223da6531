// Nav2's own NavFn, Theta* and the A* of Smac 2D on one map after the other, without ROS: `nav2-planners` compiles this file with theirs.
// What they take from ROS stands first, in the place of its headers.
//
// Standard input, in the machine's byte order: width, height, column and row of the start and of the goal as u32, then a cost of Nav2 a
// cell. Standard output for each planner: nanoseconds of processor time as u64, the count of poses as u32, 0 where there is no path, and column and row of
// each as f32, the centres of cells at the integers.
#include <array>
#include <cfloat>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#define RCLCPP_DEBUG(...)
#define RCLCPP_WARN(...)
#define RCLCPP_ERROR_THROTTLE(...)
namespace rclcpp
{
struct Logger {};
inline Logger get_logger(const char *) {return {};}
struct Parameter {};
struct Clock { using SharedPtr = std::shared_ptr<Clock>; };
}
namespace nav2
{
struct LifecycleNode
{
  using SharedPtr = std::shared_ptr<LifecycleNode>;
  rclcpp::Clock::SharedPtr get_clock() {return nullptr;}
  rclcpp::Logger get_logger() {return {};}
  template<typename T> T declare_or_get_parameter(const std::string &, T value) {return value;}
};
}
namespace rcl_interfaces::msg { struct SetParametersResult {}; }
namespace nav2_util
{
template<typename P> struct ParameterHandler
{
  using Parameters = std::vector<rclcpp::Parameter>;
  virtual void updateParametersCallback(const Parameters &) {}
  virtual rcl_interfaces::msg::SetParametersResult validateParameterUpdatesCallback(const Parameters &) {return {};}
};
}
namespace geometry_msgs::msg
{
struct Point
{
  double x = 0, y = 0, z = 0;
  bool operator==(const Point & other) const {return x == other.x && y == other.y && z == other.z;}
};
struct Pose { Point position; };
struct PoseStamped { Pose pose; };
}
namespace nav_msgs::msg
{
struct OccupancyGrid
{
  struct
  {
    uint32_t width, height;
    float resolution;
    geometry_msgs::msg::Pose origin;
  } info;
  std::vector<int8_t> data;
};
}

#include "nav2_core/planner_exceptions.hpp"
#include "nav2_costmap_2d/src/costmap_2d.cpp"
namespace nav2_costmap_2d
{
using Footprint = std::vector<geometry_msgs::msg::Point>;
struct Costmap2DROS { Costmap2D * map; Costmap2D * getCostmap() {return map;} };
template<typename C> struct FootprintCollisionChecker
{
  explicit FootprintCollisionChecker(C map) : costmap_(map) {}
  C getCostmap() {return costmap_;}
  double footprintCost(const Footprint &) {return 0;}
  C costmap_;
};
}
// Smac's A* names the planners of cars, whose curves of OMPL the one in two dimensions does not draw.
namespace nav2_smac_planner
{
struct NodeHybrid {};
struct NodeLattice {};
}
#include "nav2_smac_planner/collision_checker.hpp"
#include "nav2_smac_planner/types.hpp"
namespace nav2_smac_planner
{
template<typename N> struct AnalyticExpansion
{
  template<typename ... A> explicit AnalyticExpansion(const A & ...) {}
  template<typename A> void setCollisionChecker(A) {}
  template<typename A> void setContext(A) {}
  template<typename ... A> N * tryAnalyticExpansion(A & ...) {return nullptr;}
};
}

#include "nav2_navfn_planner/src/navfn.cpp"
#include "nav2_theta_star_planner/src/theta_star.cpp"
#include "nav2_smac_planner/a_star.hpp"
#include "nav2_smac_planner/src/collision_checker.cpp"
#include "nav2_smac_planner/src/node_2d.cpp"

using Path = std::vector<std::array<float, 2>>;
using Map = nav2_costmap_2d::Costmap2D;

static bool goes_on() {return false;}

// As NavfnPlanner::makePlan, with its defaults: no A*, unknown cells allowed, up to four times the longer side in steps.
static Path navfn(Map & map, int * start, int * goal)
{
  static nav2_navfn_planner::NavFn planner(1, 1);
  const int width = map.getSizeInCellsX(), height = map.getSizeInCellsY();
  planner.setNavArr(width, height);
  planner.setCostmap(map.getCharMap(), true, true);
  planner.setStart(goal);
  planner.setGoal(start);
  planner.calcNavFnDijkstra(goes_on, true);
  Path path;
  if (planner.potarr[goal[1] * width + goal[0]] < POT_HIGH) {
    planner.setStart(goal);
    const int length = planner.calcPath(4 * std::max(width, height));
    for (int i = length - 1; i >= 0; --i) {
      path.push_back({planner.getPathX()[i], planner.getPathY()[i]});
    }
  }
  return path;
}

static Path theta_star(Map & map, int * start, int * goal)
{
  // The defaults of its ParameterHandler.
  static nav2_theta_star_planner::Parameters parameters{2.0, 1.0, 1.0, 8, true, 5000, false};
  static nav2_theta_star_planner::ThetaStar planner(&parameters);
  planner.costmap_ = &map;
  planner.src_ = {start[0], start[1]};
  planner.dst_ = {goal[0], goal[1]};
  std::vector<coordsW> points;
  Path path;
  if (!planner.isUnsafeToPlan() && planner.generatePath(points, goes_on)) {
    for (const auto & point : points) {
      path.push_back({float(point.x - 0.5), float(point.y - 0.5)});
    }
  }
  return path;
}

// As SmacPlanner2D, with its defaults and without its smoother, which is made of OMPL's curves.
static Path smac(Map & map, int * start, int * goal)
{
  using namespace nav2_smac_planner;
  SearchInfo search;
  search.cost_penalty = 1.0;
  int iterations = 1000000;
  AStarAlgorithm<Node2D> planner(MotionModel::TWOD, search);
  planner.initialize(true, iterations, 1000, 5000, 2.0, 0.0, 1);
  auto costmap = std::make_shared<nav2_costmap_2d::Costmap2DROS>();
  costmap->map = &map;
  GridCollisionChecker checker(costmap, 1, nullptr);
  checker.setFootprint({}, true, 0.0);
  planner.setCollisionChecker(&checker);
  planner.setStart(start[0], start[1], 0);
  planner.setGoal(goal[0], goal[1], 0);
  Node2D::CoordinateVector points;
  Path path;
  int done = 0;
  if (planner.createPath(points, done, 0.125f / 0.05f, goes_on)) {
    for (auto point = points.rbegin(); point != points.rend(); ++point) {
      path.push_back({point->x, point->y});
    }
  }
  return path;
}

// Other work beside it does not count.
static uint64_t processor_time()
{
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * uint64_t(1000000000) + now.tv_nsec;
}

int main()
{
  uint32_t head[6];
  while (fread(head, sizeof(head), 1, stdin) == 1) {
    Map map(head[0], head[1], 1.0, 0.0, 0.0);
    const size_t cells = size_t(head[0]) * head[1];
    if (fread(map.getCharMap(), 1, cells, stdin) != cells) {
      return 1;
    }
    for (auto plan : {navfn, theta_star, smac}) {
      int start[2] = {int(head[2]), int(head[3])}, goal[2] = {int(head[4]), int(head[5])};
      const uint64_t began = processor_time();
      Path path;
      try {
        path = plan(map, start, goal);
      } catch (const std::exception & why) {
        fprintf(stderr, "%s\n", why.what());
      }
      const uint64_t took = processor_time() - began;
      const uint32_t count = path.size();
      fwrite(&took, sizeof(took), 1, stdout);
      fwrite(&count, sizeof(count), 1, stdout);
      fwrite(path.data(), sizeof(path[0]), count, stdout);
    }
    fflush(stdout);
  }
  return 0;
}
