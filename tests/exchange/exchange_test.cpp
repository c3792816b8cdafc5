#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "host_tools/exchange/certificate.hpp"
#include "host_tools/support/files.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;
namespace fs = std::filesystem;

constexpr std::size_t changed = 1;  ///< the joint whose entry in the file is changed
const std::string changed_name = "joint_2";

/// Published moments miss the triangle inequality A + B >= C, which MuJoCo asks for.
void make_possible(Inertial& body) {
  const Eigen::Vector3d moments = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(body.tensor).eigenvalues();
  const double missing = moments[2] - moments[1] - moments[0];
  if (missing > -1e-6) body.tensor += (missing + 1e-6) * Eigen::Matrix3d::Identity();
}

IdentifiedModel possible_puma() {
  Robot robot = test::puma_with_friction().robot;
  for (Joint& joint : robot.joints) make_possible(*joint.inertial);
  IdentifiedModel model = test::plant_of(robot);
  model.joints = test::puma_with_friction().joints;
  for (JointFit& joint : model.joints) joint.tau_limit = 100;
  return model;
}

/// The PUMA 560 with its published rotors and friction, and logs that know its torques exactly.
class Exchange : public testing::TestWithParam<const char*> {
 protected:
  Exchange() : format(export_format(GetParam())), model(possible_puma()) {
    train = test::processed({test::exact_log(model, Role::train, 1)});
    held_out = test::processed({test::exact_log(model, Role::test, 2)});
  }
  SimpleRobot simple() const {
    SimpleRobot out = simple_robot(model, model.robot, format.has_armature, train);
    out.urdf = test::puma560;
    return out;
  }
  fs::path file() const { return test::folder() / format.file; }
  Certificate written(const SimpleRobot& robot) const {
    format.write(robot, file());
    return certify(format, file(), robot, model, held_out);
  }
  bool is(const std::string& name) const { return name == format.name; }
  /// As a reader that has another opinion of the unit would have it.
  /// @param before what stands before the number, one after another
  void change(const std::vector<std::string>& before, const std::function<double(double)>& how) const {
    const std::string text = read_file(file());
    std::size_t from = 0;
    for (const std::string& word : before) {
      from = text.find(word, from);
      ASSERT_NE(from, std::string::npos) << word;
      from += word.size();
    }
    const std::size_t to = text.find_first_of("\"<,}\n", from);
    const double value = std::stod(text.substr(from, to - from));
    write_file(file(), text.substr(0, from) + fmt::format("{:.17g}", how(value)) + text.substr(to));
  }
  /// Where the numbers of the changed joint are: viscous and dry friction, rotor.
  std::array<std::vector<std::string>, 3> places() const {
    const auto all = [](const std::string& joint, std::array<const char*, 3> names) {
      return std::array<std::vector<std::string>, 3>{{{joint, names[0]}, {joint, names[1]}, {joint, names[2]}}};
    };
    const std::string key = "\"" + changed_name + "\":";
    if (is("isaaclab")) return {{{"\nVISCOUS_FRICTION = ", key}, {"\nFRICTION = ", key}, {"\nARMATURE = ", key}}};
    if (is("bam")) return all(key, {"\"friction_viscous\": ", "\"friction_base\": ", "\"armature\": "});
    if (is("usd")) {
      return all("over \"" + changed_name + "\"",
                 {":viscousFrictionCoefficient = ", ":dynamicFrictionEffort = ", ":armature = "});
    }
    const std::string joint = "<joint name=\"" + changed_name + "\"";
    if (is("sdf")) return all(joint, {"<damping>", "<friction>", ""});
    return all(joint, {"damping=\"", is("mjcf") ? "frictionloss=\"" : "friction=\"", "armature=\""});
  }
  /// Of the formats that leave the bodies to a URDF beside them.
  fs::path file_of_bodies() const {
    const bool beside = is("isaaclab") || is("bam") || is("usd");
    return beside ? fs::path(file()).replace_extension(".urdf") : file();
  }

  const ExportFormat& format;
  IdentifiedModel model;
  std::vector<ProcessedLog> train, held_out;
};

TEST_P(Exchange, FileSaysWhatWasMeant) {
  const SimpleRobot robot = simple();
  const Certificate certificate = written(robot);
  EXPECT_NO_THROW(require_as_meant(certificate));
  for (const JointCertificate& joint : certificate.joints) {
    EXPECT_LE(joint.misread, 1e-6 * joint.largest) << joint.name;
    EXPECT_GT(joint.sliding_share, 0.5) << joint.name;
  }
}

TEST_P(Exchange, ViscousAndDryFrictionAreTheModelsOwn) {
  const SimpleRobot robot = simple();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const double viscous = model.joints[j].find("viscous")->linear[0], dry = model.joints[j].find("coulomb")->linear[0];
    const double rotor = model.joints[j].find("rotor_inertia")->linear[0];
    EXPECT_EQ(robot.joints[j].armature, format.has_armature ? rotor : 0);
    if (!format.has_armature) continue;  // there, friction takes what it can of the rotor's torque
    EXPECT_NEAR(robot.joints[j].damping, viscous, 0.01 * viscous);
    EXPECT_NEAR(robot.joints[j].friction, dry, 0.01 * dry);
  }
}

TEST_P(Exchange, ErrorsInTheFileAreFound) {
  constexpr double degrees = 180 / 3.14159265358979323846, gear = 62.61;
  const auto [viscous, dry, rotor] = places();
  struct Injected {
    std::string what;
    std::vector<std::string> place;
    std::function<double(double)> how;
  };
  std::vector<Injected> errors{
      {"sign of damping", viscous, [](double x) { return -x; }},
      {"sign of friction", dry, [](double x) { return -x; }},
      {"damping per degree", viscous, [](double x) { return x / degrees; }},
      {"damping times 57.3", viscous, [](double x) { return x * degrees; }},
      {"friction times 57.3", dry, [](double x) { return x * degrees; }},
      {"damping at the motor", viscous, [](double x) { return x / (gear * gear); }},
      {"friction at the motor", dry, [](double x) { return x / gear; }},
      {"friction left out", dry, [](double) { return 0.0; }},
      {"damping off by 1 %", viscous, [](double x) { return 1.01 * x; }},
  };
  if (format.has_armature) {
    errors.push_back({"rotor at the motor", rotor, [](double x) { return x / (gear * gear); }});
    errors.push_back({"rotor times 57.3", rotor, [](double x) { return x * degrees; }});
  }
  const SimpleRobot robot = simple();
  for (const Injected& error : errors) {
    const Certificate right = written(robot);
    change(error.place, error.how);
    const Certificate wrong = certify(format, file(), robot, model, held_out);
    EXPECT_FALSE(wrong.as_meant()) << error.what;
    EXPECT_THROW(require_as_meant(wrong), DataError) << error.what;
    for (std::size_t j = 0; j < wrong.joints.size(); ++j)
      EXPECT_EQ(wrong.joints[j].as_meant, j != changed) << error.what << ", " << wrong.joints[j].name;
    if (!format.has_armature) continue;
    // the model fits the log exactly, so any error shows in the measured torque too
    EXPECT_GT(wrong.joints[changed].file_rmse, right.joints[changed].file_rmse) << error.what;
  }
}

TEST_P(Exchange, BodiesThatAreChangedAreFound) {
  const SimpleRobot robot = simple();
  format.write(robot, file());
  const fs::path bodies = file_of_bodies();
  std::string text = read_file(bodies);
  const std::string mass = is("mjcf") ? "mass=\"" : is("sdf") ? "<mass>" : "<mass value=\"";
  const std::size_t at = text.rfind(mass);
  ASSERT_NE(at, std::string::npos);
  text.insert(at + mass.size(), "1");  // 0.09 -> 10.09 kg
  write_file(bodies, text);
  EXPECT_FALSE(certify(format, file(), robot, model, held_out).as_meant());
}

/// Without dry friction, whose soft turn in MuJoCo is a loss of its own.
void remove_dry_friction(IdentifiedModel& model) {
  for (JointFit& joint : model.joints)
    std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.effect == "coulomb"; });
}

/// A joint's torque beside its body's in the test below, written down once more.
Eigen::VectorXd rest_of(const ProcessedLog& log, double viscous, double rotor, double spring) {
  const MotionRows motion = log.joint_motion(changed);
  return viscous * motion.dq.col(0) + rotor * motion.ddq.col(0) + spring * motion.q.col(0);
}

TEST_P(Exchange, LossIsThatOfWhatIsLeftOut) {
  constexpr double spring = 20;
  remove_dry_friction(model);
  model.joints[changed].effects.push_back(test::effect("spring", {}, {spring, 0}));
  train = test::processed({test::exact_log(model, Role::train, 1)});
  held_out = test::processed({test::exact_log(model, Role::test, 2)});
  const JointCertificate joint = written(simple()).joints[changed];
  const double rotor = format.has_armature ? 0 : model.joints[changed].find("rotor_inertia")->linear[0];
  const double viscous = model.joints[changed].find("viscous")->linear[0];
  // least squares once more, by another method
  const ProcessedLog &from = train[0], &over = held_out[0];
  const Eigen::VectorXd dq = from.joint_velocity(changed), rest = rest_of(from, viscous, rotor, spring);
  MatrixXd columns(from.last - from.first, 2);
  columns << dq.segment(from.first, from.last - from.first), dq.segment(from.first, from.last - from.first).cwiseSign();
  const Eigen::ArrayXd used =
      (columns.col(0).array().abs() > 3 * model.joints[changed].sign_width).cast<double>().eval();
  const Eigen::VectorXd right = (rest.segment(from.first, columns.rows()).array() * used).matrix();
  for (auto column : columns.colwise()) column.array() *= used;
  Eigen::VectorXd x = columns.colPivHouseholderQr().solve(right);
  if (x[1] < 0) x << columns.col(0).dot(right) / columns.col(0).squaredNorm(), 0;
  ASSERT_GE(x.minCoeff(), 0);
  ASSERT_TRUE(joint.written.has_value());
  EXPECT_NEAR(joint.written->damping, x[0], 1e-6 * x[0]);
  EXPECT_NEAR(joint.written->friction, x[1], 1e-6 * x[0]);
  const Eigen::VectorXd fast = over.joint_velocity(changed);
  const Eigen::VectorXd lost = rest_of(over, viscous, rotor, spring) - x[0] * fast - x[1] * fast.cwiseSign();
  const double expected = test::rms(over.filter_columns(lost).middleRows(over.first, over.last - over.first));
  EXPECT_GT(expected, 5);
  EXPECT_NEAR(joint.cannot_say, expected, 0.01 * expected);
  EXPECT_NEAR(joint.file_rmse, joint.cannot_say, 1e-6 * joint.cannot_say);  // the log is the model's own
  EXPECT_LT(joint.model_rmse, 1e-6);
  EXPECT_EQ(joint.left_out.back(), "spring");
}

TEST_P(Exchange, WhatIsLeftOutIsNamed) {
  model.joints[changed].effects.push_back(test::effect("ripple", {20}, {2, 0}));
  model.body = {test::effect("gravity_tilt", {}, {0.01, 0}), test::effect("payload", {}, {1, 0, 0, 0})};
  std::vector<std::string> expected{"rotor_inertia", "ripple", "gravity_tilt"};
  if (format.has_armature) expected.erase(expected.begin());
  EXPECT_EQ(left_out(model, changed, format.has_armature), expected);
}

TEST_P(Exchange, PayloadIsPartOfTheLastLink) {
  remove_dry_friction(model);
  model.body = {test::effect("payload", {}, {3, 0.02, -0.01, 0.1})};
  train = test::processed({test::exact_log(model, Role::train, 1)});
  held_out = test::processed({test::exact_log(model, Role::test, 2)});
  const SimpleRobot robot = simple();
  EXPECT_NEAR(robot.robot.joints.back().inertial->mass, model.robot.joints.back().inertial->mass + 3, 1e-12);
  const Certificate certificate = written(robot);
  EXPECT_TRUE(certificate.as_meant());
  if (!format.has_armature) return;
  for (const JointCertificate& joint : certificate.joints)  // nothing is lost: MuJoCo moves the same robot
    EXPECT_LT(joint.file_rmse, 1e-6 * joint.largest) << joint.name;
}

TEST_P(Exchange, NoTrainLogIsRefused) {
  EXPECT_THROW(simple_robot(model, model.robot, format.has_armature, {}), DataError);
}

TEST_P(Exchange, LinkWithoutMassIsRefused) {
  Robot bodies = model.robot;
  bodies.joints[3].inertial.reset();
  EXPECT_THROW(simple_robot(model, bodies, format.has_armature, train), DataError);
}

TEST_P(Exchange, CertificateHoldsWhatTheTableSays) {
  const Certificate certificate = written(simple());
  const nlohmann::json json = to_json(certificate);
  EXPECT_EQ(json.at("format"), format.name);
  EXPECT_EQ(json.at("joints").size(), 6U);
  EXPECT_EQ(json.at("joints")[1].at("cannot_say").get<double>(), certificate.joints[1].cannot_say);
  const std::string table = certificate_table(certificate);
  for (const JointCertificate& joint : certificate.joints) {
    EXPECT_NE(table.find(joint.name), std::string::npos);
    EXPECT_NE(table.find(fmt::format("{:.4g}", joint.cannot_say)), std::string::npos);
    EXPECT_NE(table.find(fmt::format("{:.4g}", joint.cannot_say_in_motion)), std::string::npos);
    EXPECT_EQ(joint.friction_model, is("bam") ? "m1" : "");
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, Exchange, testing::Values("urdf", "mjcf", "sdf", "isaaclab", "bam", "usd"),
                         [](const auto& instance) { return std::string(instance.param); });

TEST(ExportFormats, UnknownOneIsRefusedWithThoseThereAre) {
  try {
    export_format("sldprt");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("urdf, mjcf, sdf, drake, isaaclab, bam, usd"), std::string::npos)
        << error.what();
  }
}

TEST(ExportFormats, MujocoRefusesImpossibleBodies) {
  IdentifiedModel model = test::puma_with_friction();
  SimpleRobot robot{model.robot, std::vector<SimpleJoint>(6), test::puma560};
  robot.robot.joints[0].inertial->tensor = Eigen::Vector3d(1, 1, 5).asDiagonal();  // A + B < C
  const fs::path file = test::folder() / "impossible.xml";
  write_mjcf(robot, file);
  const MotionRows rest{MatrixXd::Zero(1, 6), MatrixXd::Zero(1, 6), MatrixXd::Zero(1, 6)};
  EXPECT_THROW(replay_mjcf(file, model, rest, 0.001), DataError);
}

/// Any axes and frames, a slide among them, and names that XML has other uses for.
void expect_read_as_meant(const ExportFormat& format, unsigned seed) {
  Robot robot = test::Chains(seed).robot(4);
  robot.name = "one & only";
  robot.joints[0].name = "a & \"b\" <c>";
  for (Joint& joint : robot.joints) joint.link = joint.name + " >'link'";
  for (Joint& joint : robot.joints) make_possible(*joint.inertial);
  IdentifiedModel model = test::plant_of(robot);
  SimpleRobot simple{robot, std::vector<SimpleJoint>(4, SimpleJoint{2, 3, format.has_armature ? 0.5 : 0, 10}), {}};
  const fs::path file = test::folder() / "slides.xml";
  format.write(simple, file);
  const Reference motion = test::motion_of(robot, 0.002, 2);
  const MatrixXd meant = predict(as_model(simple, model), motion.q, motion.dq, motion.ddq, motion.step_s);
  const ReplayedTorque read = format.replay(file, model, {motion.q, motion.dq, motion.ddq}, motion.step_s);
  const MatrixXd off = ((read.tau - meant).array() * read.sliding.array()).matrix();
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-6 * meant.cwiseAbs().maxCoeff()) << format.name << ", seed " << seed;
  EXPECT_GT(read.sliding.mean(), 0.5) << format.name;
}

TEST(ExportFormats, PrismaticJointsAndNamesThatNeedCare) {
  for (unsigned seed = 1, found = 0; found < 3; ++seed) {
    if (!test::slides(test::Chains(seed).robot(4))) continue;
    ++found;
    for (const char* name : {"mjcf", "sdf"}) expect_read_as_meant(export_format(name), seed);
  }
}

TEST(ExportFormats, SdfTurnsOfNinetyDegreesAreExact) {
  IdentifiedModel model = possible_puma();
  for (Joint& joint : model.robot.joints)
    joint.origin.linear() = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY()).toRotationMatrix() *
                            Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const SimpleRobot simple{model.robot, std::vector<SimpleJoint>(6), {}};
  const fs::path file = test::folder() / "turned.sdf";
  write_sdf(simple, file);
  const MatrixXd q = MatrixXd::Constant(1, 6, 0.4), dq = MatrixXd::Constant(1, 6, 1), ddq = MatrixXd::Constant(1, 6, 2);
  const MatrixXd meant = predict(as_model(simple, model), q, dq, ddq, 0.001);
  EXPECT_LT((replay_sdf(file, model, {q, dq, ddq}, 0.001).tau - meant).norm(), 1e-12 * meant.norm());
}

// libsdformat looks for a home once in a process: this shows something where it runs alone, as under ctest.
TEST(ExportFormats, ReadingSdfLeavesNothingInTheUsersHome) {
  const fs::path home = test::folder() / "home";
  fs::create_directory(home);
  const char* had = std::getenv("HOME");
  const std::optional<std::string> before = had == nullptr ? std::nullopt : std::optional<std::string>(had);
  setenv("HOME", home.c_str(), 1);
  const IdentifiedModel model = possible_puma();
  const fs::path file = test::folder() / "home.sdf";
  write_sdf({model.robot, std::vector<SimpleJoint>(6), {}}, file);
  const MotionRows rest{MatrixXd::Zero(1, 6), MatrixXd::Zero(1, 6), MatrixXd::Zero(1, 6)};
  replay_sdf(file, model, rest, 0.001);
  EXPECT_EQ(std::string(std::getenv("HOME")), home.string());
  EXPECT_TRUE(fs::is_empty(home));
  if (before)
    setenv("HOME", before->c_str(), 1);
  else
    unsetenv("HOME");
}

TEST(ExportFormats, SdfNeedsANameForEachLinkAndJoint) {
  const IdentifiedModel model = possible_puma();
  for (const char* name : {"joint_2", "world", "a::b", "__root__", ""}) {
    SimpleRobot robot{model.robot, std::vector<SimpleJoint>(6), {}};
    robot.robot.joints[1].name = "joint_2";
    robot.robot.joints[3].link = name;
    const fs::path file = test::folder() / "names.sdf";
    EXPECT_THROW(write_sdf(robot, file), InputError) << name;
    EXPECT_FALSE(fs::exists(file)) << name;
  }
}

TEST(ExportFormats, SdfOfAnotherRobotIsRefused) {
  const IdentifiedModel model = possible_puma();
  const MotionRows rest{MatrixXd::Zero(1, 6), MatrixXd::Zero(1, 6), MatrixXd::Zero(1, 6)};
  const auto refused = [&](const std::string& text) {
    const fs::path file = test::folder() / "other.sdf";
    write_file(file, text);
    EXPECT_THROW(replay_sdf(file, model, rest, 0.001), DataError) << text.substr(0, 200);
  };
  refused("no XML");
  refused("<sdf version=\"1.7\"><model name=\"m\"><link name=\"one\"/></model></sdf>");
  const fs::path file = test::folder() / "right.sdf";
  write_sdf({model.robot, std::vector<SimpleJoint>(6), {}}, file);
  std::string text = read_file(file);
  const std::size_t axis = text.find("<axis>");
  refused(std::string(text).insert(axis, "<pose>1e-6 0 0 0 0 0</pose>"));  // a joint beside its link's origin
  refused(std::string(text).insert(axis, "<pose>0 0 0 0 0 0.001</pose>"));
}

TEST(ExportFormats, UrdfKeepsWhatItDoesNotKnow) {
  const fs::path original = test::write("own.urdf", R"(<robot name="own"><!-- kept -->
<link name="base"/><link name="arm"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<dynamics damping="99" friction="99"/></joint><gazebo reference="arm"><mu1>0.2</mu1></gazebo></robot>)");
  Robot robot = read_urdf(original);
  robot.joints[0].inertial = Inertial{2, {0.1, 0, 0}, 0.1 * Eigen::Matrix3d::Identity()};
  const fs::path file = test::folder() / "own_out.urdf";
  write_urdf_dynamics({robot, {SimpleJoint{0.5, 0.25, 0, 0}}, original}, file);
  const std::string text = read_file(file);
  for (const char* kept : {"kept", "<box size=\"1 1 1\"", "<mu1>0.2</mu1>", "damping=\"0.5\" friction=\"0.25\""})
    EXPECT_NE(text.find(kept), std::string::npos) << kept;
  EXPECT_EQ(text.find("99"), std::string::npos);
}

}  // namespace
}  // namespace fxdyn
